"""The recorder: topics in, demonstrations out."""
