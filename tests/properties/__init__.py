"""Requests that nobody would write, of every kind: each is answered, or refused with a reason that
names a field."""
