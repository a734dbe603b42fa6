"""What lag of the motors a log shows by thrust alone, and what it rests on."""
