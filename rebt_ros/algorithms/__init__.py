"""The paper: RE:BT-Espresso as functions that read like its pseudo-code."""
