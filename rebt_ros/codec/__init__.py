"""JSON declared once: what a form describes, it reads, writes and explains to other programs."""
