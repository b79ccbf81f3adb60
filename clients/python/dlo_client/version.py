"""The one source of the version: the client's, the library's, the service's, the changelog's and
the tag's."""

__version__ = "0.2.0"
