"""Measured data: flight logs, their readers, and the wrench on a logged flight."""
