"""What a recording comes to in other programs' formats, and in a report for people."""
