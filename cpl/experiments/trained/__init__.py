"""What is trained, and how it is read back: base policies, forecasters, agents."""
