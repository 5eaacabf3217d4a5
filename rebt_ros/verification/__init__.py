"""What a learned tree does in every state: rules that it must keep, proofs, and explanations."""
