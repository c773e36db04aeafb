"""What do the theorems promise, as printed and as corrected?"""
