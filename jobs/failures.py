"""These are the messages to users when the service itself fails; its log says what happened."""

LOST = "its process died {deaths} times (killed, crashed, out of memory or over the time limit) in {attempts} attempts at"
ON_LOSS = "give the workers more memory or time, or ask for less"
IN_LOG = "try again; the service's log has the details"
