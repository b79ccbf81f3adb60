"""Networks that users adapt or bring: their file, and where they are kept. Imports nothing that
computes."""
