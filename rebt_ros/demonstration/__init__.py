"""What was shown: state features, demonstrations, and the table with the last action taken."""
