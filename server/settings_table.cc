#include "server/settings.h"
#include "telemetry/lcm_link.h"

namespace joulecast {
namespace {

using Type = Setting::Type;
constexpr std::string_view store_synchronous[] = {"full", "normal"};
constexpr std::string_view log_formats[] = {"text", "json"};
constexpr std::string_view log_levels[] = {"debug", "info", "warning", "error"};
constexpr std::string_view mqtt_dialects[] = {"vda5050-3.0", "vda5050-2.1"};
constexpr double megabyte = 1024.0 * 1024.0;

// key, type, default, minimum, maximum, unit, help
constexpr Setting table[] = {
    {"lcm.url", Type::text, telemetry::default_lcm_url, 0, 0, "",
     "LCM provider; ttl is how far the messages that joulecastd sends may travel and does not limit what it "
     "receives, recv_buf_size asks the kernel for a receive buffer of so many bytes, at most "
     "net.core.rmem_max"},
    {"lcm.bind_address", Type::text, "", 0, 0, "",
     "IPv4 address of the interface to receive on; empty: the one that the system routes the multicast group "
     "to"},
    {"lcm.accept_from", Type::text, "local", 0, 0, "",
     "senders whose datagrams are taken, separated by commas: networks such as 10.1.0.0/16, addresses, any, "
     "or local: "
     "loopback and the networks of this host's interfaces; further ones are counted"},

    {"http.address", Type::text, "127.0.0.1", 0, 0, "",
     "IP address to listen on; one that is not loopback needs auth.token_file or http.insecure"},
    {"http.tls_certificate", Type::text, "", 0, 0, "",
     "PEM file of the certificate and those that it builds on, read again at SIGHUP; with http.tls_key: "
     "HTTPS "
     "alone, TLS 1.2 or newer"},
    {"http.tls_key", Type::text, "", 0, 0, "", "PEM file of the certificate's private key"},
    {"http.tls_client_authorities", Type::text, "", 0, 0, "",
     "PEM file of certificate authorities: only clients with a certificate of one of them are accepted"},
    {"http.insecure", Type::boolean, "false", 0, 0, "",
     "let everybody who reaches http.address do everything, though there are no tokens"},
    {"http.port", Type::integer, "8080", 0, 65535, "", "port to listen on; 0 lets the system choose"},
    {"http.allowed_hosts", Type::text, "", 0, 0, "",
     "names under which clients may address the service besides IP addresses, localhost and this host's "
     "name, "
     "separated by commas; *: any; others: 421"},
    {"http.trusted_proxies", Type::text, "", 0, 0, "",
     "IP addresses of reverse proxies, separated by commas: their X-Forwarded-For says who a request is "
     "from, in "
     "the audit and for the limits of each client, and their X-Forwarded-Proto whether it came by HTTPS"},
    {"http.allowed_origins", Type::text, "", 0, 0, "",
     "origins of pages elsewhere that browsers let use the service, such as https://fleet.example, separated "
     "by commas; empty: none"},
    {"http.worker_threads", Type::integer, "2", 1, 64, "", "threads for requests that read the store"},
    {"http.compute_threads", Type::integer, "2", 1, 64, "", "threads for requests that compute"},
    {"http.worker_queue", Type::integer, "256", 1, 65536, "",
     "requests that may wait for threads of one kind; beyond: 503"},
    {"http.client_requests", Type::integer, "64", 1, 65536, "",
     "requests of one client, a token or an address without one, that may wait or compute; beyond: 429"},
    {"http.request_deadline_s", Type::number, "30", 0.1, 86400, "s",
     "waiting and computing of one request; beyond: 503, and it is cancelled, but for a change that has "
     "begun"},
    {"http.max_connections", Type::integer, "1024", 1, 100000, "",
     "connections open at once; beyond: one of the address with most is closed that is idle or has not sent "
     "its whole request, or else 503"},
    {"http.client_connections", Type::integer, "256", 1, 100000, "",
     "connections of one client address; beyond: its longest idle one is closed, or else 503"},
    {"http.max_header_bytes", Type::integer, "16384", 1024, 1048576, "B",
     "request line and headers; beyond: 431"},
    {"http.max_body_bytes", Type::integer, "4194304", 1024, 256 * megabyte, "B", "request body; beyond: 413"},
    {"http.max_bodies_bytes", Type::integer, "67108864", 1024, 64 * 1024 * megabyte, "B",
     "bodies of all requests not yet answered, a quarter of one client; beyond: 429, or the largest client's "
     "largest is cut off, or else 503"},
    {"http.read_timeout_s", Type::number, "10", 0.1, 3600, "s", "from a request's first byte to its last"},
    {"http.write_timeout_s", Type::number, "30", 0.1, 3600, "s", "without progress of an answer"},
    {"http.idle_timeout_s", Type::number, "60", 0.1, 86400, "s", "between the requests of a connection"},
    {"http.stop_deadline_s", Type::number, "5", 0, 600, "s",
     "time for running requests to finish when stopping"},
    {"http.event_queue_bytes", Type::integer, "8388608", 4096, 64 * megabyte, "B",
     "unsent events a client of the event stream may have before it is dropped; of a robot's states only the "
     "newest waits, about 2 kB"},
    {"http.event_streams", Type::integer, "256", 1, 100000, "",
     "open event streams, a quarter of one client; beyond: the largest client's oldest ends, or else 503"},
    {"http.web_directory", Type::text, "", 0, 0, "",
     "serve the operator page from this directory; empty: the page built in"},

    {"auth.token_file", Type::text, "", 0, 0, "",
     "file of the tokens that requests need, made by joulecast token create and read again when it changes; "
     "empty: none is needed"},

    {"webhooks.file", Type::text, "", 0, 0, "",
     "file of the URLs that receive events, see operations.md; empty: none"},
    {"webhooks.queue", Type::integer, "1000", 1, 1000000, "",
     "events that may wait for one of these; beyond: the oldest is dropped and counted"},

    {"mqtt.url", Type::text, "", 0, 0, "",
     "MQTT broker that is told the batteries of live robots, mqtt://host[:port] or mqtts://host[:port]; "
     "empty: none"},
    {"mqtt.authorities", Type::text, "", 0, 0, "",
     "PEM file of the certificate authorities that the broker's certificate is of; empty: those of the "
     "system"},
    {"mqtt.user", Type::text, "", 0, 0, "", "name by which the broker knows joulecastd; empty: none"},
    {"mqtt.password_file", Type::text, "", 0, 0, "",
     "file that holds this user's password, for no other user to read"},
    {"mqtt.client_id", Type::text, "joulecast", 0, 0, "",
     "MQTT client identifier; each daemon on a broker needs one of its own"},
    {"mqtt.interface", Type::text, "joulecast", 0, 0, "",
     "first level of the topics, the interface name of VDA 5050; not the one that the robots use"},
    {"mqtt.manufacturer", Type::text, "unknown", 0, 0, "",
     "manufacturer of the robots, a level of the topics"},
    {"mqtt.dialect", Type::choice, "vda5050-3.0", 0, 0, "", "what the messages follow", mqtt_dialects},
    {"mqtt.period_s", Type::number, "5", 0.5, 3600, "s", "how often each robot's battery is published"},

    {"store.path", Type::text, "joulecast.db", 0, 0, "",
     "SQLite file of the history; beside it, PATH.spool keeps what was not committed at a stop"},
    {"store.url", Type::text, "", 0, 0, "",
     "database of the history: sqlite:PATH or postgresql://user@host1,host2/database; empty: sqlite: and "
     "store.path"},
    {"store.read_url", Type::text, "", 0, 0, "",
     "standby of the PostgreSQL of store.url that answers questions of the history; the answer says how old "
     "it "
     "may be; empty: none"},
    {"store.read_staleness_s", Type::number, "5", 0.5, 3600, "s",
     "age of what this standby shows beyond which the server of store.url answers instead"},
    {"store.synchronous", Type::choice, "full", 0, 0, "",
     "what an acknowledged commit to the SQLite file survives: full, also a power cut; normal, for slow "
     "disks, "
     "the end of the daemon only",
     store_synchronous},
    {"store.retention_days", Type::number, "30", 0, 36500, "d",
     "age at which raw telemetry is deleted, at most 5 % of it an hour; 0: never"},
    {"store.retention_bytes", Type::integer, "10737418240", 0, 1e15, "B",
     "size of raw telemetry beyond which the oldest is deleted; 0: no limit"},
    {"store.retention_missions_days", Type::number, "0", 0, 36500, "d",
     "age since their end, by the robot's clock, at which missions are deleted with all that is stored of "
     "them, "
     "at most 5 % of them an hour; 0: never"},
    {"store.retention_events", Type::integer, "1000000", 0, 1e12, "",
     "events kept; beyond: the oldest are deleted; 0: no limit"},
    {"store.queue_bytes", Type::integer, "67108864", 1048576, 1e12, "B",
     "memory for what waits while the store takes no data; beyond: raw samples are left out and counted"},

    {"cluster.name", Type::text, "", 0, 0, "",
     "name of the cluster of daemons that share the fleet and the PostgreSQL of store.url; empty: this one "
     "keeps all robots that it hears"},
    {"cluster.node", Type::text, "", 0, 0, "",
     "this daemon's name in the cluster, another for each; empty: the host's name"},
    {"cluster.lease_s", Type::number, "5", 2, 60, "s",
     "silence towards PostgreSQL after which other daemons of the cluster take this one's robots; one that "
     "was killed is noticed at once"},

    {"ingest.key_file", Type::text, "", 0, 0, "",
     "file of the keys by which robots sign, made by joulecast key create and read again when it changes; a "
     "robot that has a key is heard by signed messages alone; empty: none has"},
    {"ingest.require_signed", Type::boolean, "false", 0, 0, "", "refuse robots that have no key, too"},
    {"ingest.signature_age_s", Type::number, "30", 0.1, 86400, "s",
     "how far the time of a signed message may be from the host's clock; others are refused as replayed"},
    {"ingest.queue_messages", Type::integer, "200000", 1000, 1e8, "",
     "received messages that may wait to be accounted; beyond: dropped and counted"},
    {"ingest.gap_bridge_s", Type::number, "30", 0, 3600, "s",
     "longest time between two samples that is interpolated, at any rate; in a faster stream ten sample "
     "periods are, and at least 1 s. A longer time is a gap, which marks the mission incomplete"},
    {"ingest.mission_idle_timeout_s", Type::number, "300", 1, 86400, "s",
     "silence after which an unfinished mission is closed as abandoned"},
    {"ingest.implicit_missions", Type::boolean, "true", 0, 0, "",
     "open a mission for a robot that sends telemetry without having announced one"},
    {"ingest.max_unknown_robots", Type::integer, "100", 0, 1000000, "",
     "ids without a model whose messages are counted apart, silent ones are discarded after a minute; robots "
     "with "
     "a model "
     "are always followed"},
    {"ingest.reorder_s", Type::number, "0.5", 0, 60, "s",
     "how long samples wait for one that is missing before them, to be accounted in order; 0: not at all"},
    {"ingest.sender_takeover_s", Type::number, "2", 0.1, 3600, "s",
     "silence of a robot's sender after which another one under the same robot_id takes over at the latest; "
     "until then "
     "its messages wait, and are refused if the first speaks again"},
    {"ingest.max_clock_ahead_s", Type::number, "300", 0, 1e9, "s",
     "samples and events stamped further ahead of the host's clock are refused"},
    {"ingest.booked_time_margin_s", Type::number, "60", 0, 86400, "s",
     "once a robot's clock was set within a mission, its time may run ahead of the host's by so much; "
     "samples beyond are "
     "refused"},
    {"ingest.event_rate_hz", Type::number, "5", 0.01, 10000, "Hz",
     "mission events a second that a robot may send, beyond a burst of 100 and one for five samples; further "
     "ones are "
     "refused"},

    {"robots.most", Type::integer, "10000", 1, 1e6, "",
     "robots that may have a model; PUT of one more is refused, files of robots.directory are not"},
    {"robots.directory", Type::text, "", 0, 0, "", "robot files (*.json) loaded at start; empty: none"},
    {"energy_state.period_s", Type::number, "1", 0.05, 3600, "s",
     "period of each robot's energy state on LCM"},
    {"meter.tolerance", Type::number, "1e-4", 1e-9, 1e-2, "",
     "local error of the energy integration, as a fraction of the energy between two samples"},

    {"adoption.max_missions", Type::integer, "50", 1, 1000, "",
     "missions that the back-test of a new model replays at most, newest first"},
    {"adoption.max_samples", Type::integer, "400000", 1000, 1e7, "",
     "samples that the back-test of a new model replays at most: some seconds"},
    {"adoption.automatic", Type::boolean, "false", 0, 0, "",
     "adopt models that missions propose when their back-test improves, without waiting for a person"},

    {"diagnosis.queue", Type::integer, "32", 1, 10000, "", "diagnoses that may wait; beyond: 503"},
    {"diagnosis.max_missions", Type::integer, "200", 1, 1000, "",
     "missions that one diagnosis reads at most, newest first"},
    {"diagnosis.max_samples", Type::integer, "500000", 1000, 1e7, "",
     "samples that one diagnosis reads at most: bounds its memory (about 0.5 kB each) and time"},
    {"diagnosis.controls", Type::integer, "20", 0, 1000, "",
     "surrogates of the recordings on which every finding of a diagnosis is tried; 0: none"},
    {"diagnosis.threads", Type::integer, "2", 1, 64, "", "threads that these may take, at low priority"},
    {"diagnosis.max_memory_bytes", Type::integer, "1073741824", 67108864, 1e12, "B",
     "memory that a diagnosis, a process of its own, may take beyond the daemon's; it fails beyond"},
    {"diagnosis.deadline_s", Type::number, "3600", 1, 604800, "s",
     "time after which a diagnosis that has not ended fails"},
    {"watch.period_s", Type::number, "3600", 0, 31536000, "s",
     "how often every robot's missions are looked at for a drift of the gap; 0: never"},
    {"watch.robots", Type::text, "", 0, 0, "", "robots to watch, separated by commas; empty: all"},
    {"watch.least_change", Type::number, "0.01", 0.001, 1, "",
     "change of measured over modelled energy that counts as drift"},
    {"watch.diagnose", Type::boolean, "true", 0, 0, "", "start a diagnosis when a drift is found"},

    {"metrics.robots", Type::integer, "200", 0, 10000, "",
     "robots with metrics of their own at /metrics, the first by id, about 25 series each; 0: none"},

    {"log.format", Type::choice, "text", 0, 0, "", "one JSON object a line, or text for a terminal",
     log_formats},
    {"log.level", Type::choice, "info", 0, 0, "", "least level that is written", log_levels},
};

}  // namespace

std::span<const Setting> settings_table() {
  return table;
}

}  // namespace joulecast
