"""The paper's simulator (IV-A): random trees, and robots that run them on random states."""
