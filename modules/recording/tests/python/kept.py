"""What MCAP files have besides messages: profile, attachments with their lengths, names of metadata that are not ours."""

import sys

from mcap.reader import make_reader

for name in sys.argv[1:]:
    with open(name, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        attached = [f"{its.name} {its.media_type} {len(its.data)}" for its in reader.iter_attachments()]
        metadata = [f"{its.name} {its.metadata}" for its in reader.iter_metadata() if "rohrpost." not in its.name]
        print(f"{reader.get_header().profile}; {', '.join(attached)}; {', '.join(metadata)}")
