"""Our own method: sections of the skeleton, whose ends are matched jointly."""

from models.instances.section_matching.extraction import SectionMatchingParams, extract

__all__ = ["SectionMatchingParams", "extract"]
