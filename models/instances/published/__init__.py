"""The published instance methods, each with one signature and one row of
``models.instances.methods``."""
