"""What does a policy gain that switches on the tracked quantile?"""
