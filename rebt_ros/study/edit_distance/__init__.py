"""How far two behavior trees are apart: graph edit distance (paper, IV-B)."""
