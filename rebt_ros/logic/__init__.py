"""Vocabulary and algebra of Boolean rules: typed values, never strings that are parsed again."""
