"""What is the road like, and is it highway-env's?"""
