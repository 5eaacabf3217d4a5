"""Files: everything that turns them into `Demonstration` values, and rows and trees into files.

CSV table
    Any table with an event or a sample per row; one column, or several, hold the actions.
recording
    The recorder's own durable format: one file per demonstration, binary but for a line of JSON at
    its top that says where its columns came from.
bag
    A rosbag2 recording of state and action topics (a directory, an .mcap or a .db3 file).
input
    Whatever of these a user names on the command line.

All readers answer with a `Read`: the demonstration, and notes that a person should know.
"""
