"""Speed and accuracy of robotmodels, side by side with what people would pick instead."""
