"""What is asked of the package and what is taught with it.

questions/  one question each: `python -m experiments.questions.NAME` answers it and writes
            reports/NAME/;
campaigns/  experiment files of `contactopt bench`, which compare methods over problems;
course/     seven chapters with sixty exercises that grade themselves;
tutorials/  scripts that are also notebooks and pages of the documentation;
site/       the documentation;
report.py   what every question writes its report with.
"""
