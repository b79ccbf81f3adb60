"""The ``dlo`` command: one file a group of subcommands, and what they print and save."""
