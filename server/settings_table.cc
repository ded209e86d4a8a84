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
     "LCM provider. ttl limits the range of sent messages, not of received ones; recv_buf_size requests a "
     "receive buffer of that many bytes from the kernel, at most net.core.rmem_max"},
    {"lcm.bind_address", Type::text, "", 0, 0, "",
     "IPv4 address of the interface to receive on; empty: the interface that the system routes the multicast "
     "group to"},
    {"lcm.accept_from", Type::text, "local", 0, 0, "",
     "accepted senders of datagrams, separated by commas: networks such as 10.1.0.0/16, addresses, any, or "
     "local, which is loopback and the networks of this host's interfaces; datagrams of other senders are "
     "counted"},

    {"http.address", Type::text, "127.0.0.1", 0, 0, "",
     "IP address to listen on; an address other than loopback needs auth.token_file or http.insecure"},
    {"http.tls_certificate", Type::text, "", 0, 0, "",
     "PEM file of the certificate and its chain, read again at SIGHUP; with http.tls_key: HTTPS only, TLS "
     "1.2 or newer"},
    {"http.tls_key", Type::text, "", 0, 0, "", "PEM file of the certificate's private key"},
    {"http.tls_client_authorities", Type::text, "", 0, 0, "",
     "PEM file of certificate authorities; only clients with a certificate of one of them are accepted"},
    {"http.insecure", Type::boolean, "false", 0, 0, "",
     "allow unauthenticated access, with all permissions, on an address other than loopback"},
    {"http.port", Type::integer, "8080", 0, 65535, "", "port to listen on; 0 lets the system choose"},
    {"http.allowed_hosts", Type::text, "", 0, 0, "",
     "host names accepted in requests, separated by commas, in addition to IP addresses, localhost and this "
     "host's name; *: any; others: 421"},
    {"http.trusted_proxies", Type::text, "", 0, 0, "",
     "IP addresses of reverse proxies, separated by commas; their X-Forwarded-For determines the client "
     "address for the audit log and the limits per client, their X-Forwarded-Proto the use of HTTPS"},
    {"http.allowed_origins", Type::text, "", 0, 0, "",
     "origins of other sites from which browsers may use the service, such as https://fleet.example, "
     "separated by commas; empty: none"},
    {"http.worker_threads", Type::integer, "2", 1, 64, "", "threads for requests that read the store"},
    {"http.compute_threads", Type::integer, "2", 1, 64, "", "threads for requests that compute"},
    {"http.worker_queue", Type::integer, "256", 1, 65536, "",
     "requests that may wait for threads of one kind; beyond: 503"},
    {"http.client_requests", Type::integer, "64", 1, 65536, "",
     "requests of one client, which is a token or an address without one, that may wait or compute; beyond: "
     "429"},
    {"http.request_deadline_s", Type::number, "30", 0.1, 86400, "s",
     "waiting and computing time of one request; beyond: 503, and the request is cancelled unless it has "
     "begun a change"},
    {"http.max_connections", Type::integer, "1024", 1, 100000, "",
     "open connections; beyond: of the address with the most, a connection that is idle or has not sent its "
     "whole request is closed, or else 503"},
    {"http.client_connections", Type::integer, "256", 1, 100000, "",
     "connections of one client address; beyond: its longest idle one is closed, or else 503"},
    {"http.max_header_bytes", Type::integer, "16384", 1024, 1048576, "B",
     "request line and headers; beyond: 431"},
    {"http.max_body_bytes", Type::integer, "4194304", 1024, 256 * megabyte, "B", "request body; beyond: 413"},
    {"http.max_bodies_bytes", Type::integer, "67108864", 1024, 64 * 1024 * megabyte, "B",
     "bodies of all unanswered requests, at most a quarter for one client; beyond: 429, or the largest body "
     "of the largest client is cut off, or else 503"},
    {"http.read_timeout_s", Type::number, "10", 0.1, 3600, "s",
     "time from the first to the last byte of a request"},
    {"http.write_timeout_s", Type::number, "30", 0.1, 3600, "s",
     "time without progress in sending an answer"},
    {"http.idle_timeout_s", Type::number, "60", 0.1, 86400, "s", "time between two requests of a connection"},
    {"http.stop_deadline_s", Type::number, "5", 0, 600, "s",
     "time for running requests to finish at shutdown"},
    {"http.event_queue_bytes", Type::integer, "8388608", 4096, 64 * megabyte, "B",
     "unsent events for a client of the event stream; beyond: the client is disconnected. Of a robot's "
     "states only the newest is queued, about 2 kB"},
    {"http.event_streams", Type::integer, "256", 1, 100000, "",
     "open event streams, at most a quarter for one client; beyond: the oldest stream of the largest client "
     "is closed, or else 503"},
    {"http.web_directory", Type::text, "", 0, 0, "",
     "directory of the operator page; empty: the built-in page"},

    {"auth.token_file", Type::text, "", 0, 0, "",
     "file of the tokens that authenticate requests, made by joulecast token create and read again when it "
     "changes; empty: no authentication"},

    {"webhooks.file", Type::text, "", 0, 0, "",
     "file of the URLs that receive events, see operations.md; empty: none"},
    {"webhooks.queue", Type::integer, "1000", 1, 1000000, "",
     "events queued for one URL; beyond: the oldest is dropped and counted"},

    {"mqtt.url", Type::text, "", 0, 0, "",
     "MQTT broker to which the batteries of live robots are published, mqtt://host[:port] or "
     "mqtts://host[:port]; empty: none"},
    {"mqtt.authorities", Type::text, "", 0, 0, "",
     "PEM file of the certificate authorities of the broker's certificate; empty: those of the system"},
    {"mqtt.user", Type::text, "", 0, 0, "", "user name at the broker; empty: none"},
    {"mqtt.password_file", Type::text, "", 0, 0, "",
     "file of this user's password, readable only by its owner"},
    {"mqtt.client_id", Type::text, "joulecast", 0, 0, "",
     "MQTT client identifier, unique among the clients of the broker"},
    {"mqtt.interface", Type::text, "joulecast", 0, 0, "",
     "first level of the topics, the interface name of VDA 5050; not the one that the robots use"},
    {"mqtt.manufacturer", Type::text, "unknown", 0, 0, "",
     "manufacturer of the robots, a level of the topics"},
    {"mqtt.dialect", Type::choice, "vda5050-3.0", 0, 0, "", "format of the messages", mqtt_dialects},
    {"mqtt.period_s", Type::number, "5", 0.5, 3600, "s",
     "time between two publications of a robot's battery"},

    {"store.path", Type::text, "joulecast.db", 0, 0, "",
     "SQLite file of the history; data that are not committed at shutdown are kept in PATH.spool"},
    {"store.url", Type::text, "", 0, 0, "",
     "database of the history: sqlite:PATH or postgresql://user@host1,host2/database; empty: sqlite: and "
     "store.path"},
    {"store.read_url", Type::text, "", 0, 0, "",
     "standby of the PostgreSQL of store.url for queries of the history; answers contain the standby's "
     "replication delay; empty: none"},
    {"store.read_staleness_s", Type::number, "5", 0.5, 3600, "s",
     "replication delay of the standby beyond which the server of store.url is queried instead"},
    {"store.synchronous", Type::choice, "full", 0, 0, "",
     "durability of a commit to the SQLite file: full survives a loss of power; normal, for slow disks, "
     "survives a crash of the daemon only",
     store_synchronous},
    {"store.retention_days", Type::number, "30", 0, 36500, "d",
     "age at which raw telemetry is deleted, at most 5 % of it per hour; 0: never"},
    {"store.retention_bytes", Type::integer, "10737418240", 0, 1e15, "B",
     "size of raw telemetry beyond which the oldest is deleted; 0: no limit"},
    {"store.retention_missions_days", Type::number, "0", 0, 36500, "d",
     "time since the end of a mission, by the robot's clock, after which the mission and all its data are "
     "deleted, at most 5 % of the missions per hour; 0: never"},
    {"store.retention_events", Type::integer, "1000000", 0, 1e12, "",
     "stored events; beyond: the oldest are deleted; 0: no limit"},
    {"store.retention_audit_days", Type::number, "365", 0, 36500, "d",
     "age at which entries of the audit are deleted, in whole days, at most 5 % of them per hour; an entry "
     "with their number and last hash keeps the chain verifiable; 0: never"},
    {"store.queue_bytes", Type::integer, "67108864", 1048576, 1e12, "B",
     "memory for data waiting for the store; beyond: raw samples are discarded and counted"},

    {"cluster.name", Type::text, "", 0, 0, "",
     "name of the cluster of daemons that share the fleet and the PostgreSQL of store.url; empty: no "
     "cluster, this daemon keeps every robot that it receives"},
    {"cluster.node", Type::text, "", 0, 0, "",
     "this daemon's name, unique in the cluster; empty: the host's name"},
    {"cluster.lease_s", Type::number, "5", 2, 60, "s",
     "time without contact to PostgreSQL after which other daemons of the cluster take over this one's "
     "robots; the robots of a terminated daemon are taken over without this delay"},

    {"ingest.key_file", Type::text, "", 0, 0, "",
     "file of the robots' signing keys, made by joulecast key create and read again when it changes; of a "
     "robot with a key only signed messages are accepted; empty: no keys"},
    {"ingest.require_signed", Type::boolean, "false", 0, 0, "", "reject also robots without a key"},
    {"ingest.signature_age_s", Type::number, "30", 0.1, 86400, "s",
     "accepted difference between the time of a signed message and the host's clock; others are rejected as "
     "replayed"},
    {"ingest.queue_messages", Type::integer, "200000", 1000, 1e8, "",
     "received messages waiting to be accounted; beyond: dropped and counted"},
    {"ingest.gap_bridge_s", Type::number, "30", 0, 3600, "s",
     "longest time between two samples that is interpolated at any rate; in a faster stream ten sample "
     "periods, and at least 1 s, are interpolated. A longer time is a gap and marks the mission incomplete"},
    {"ingest.mission_idle_timeout_s", Type::number, "300", 1, 86400, "s",
     "silence after which an unfinished mission is closed as abandoned"},
    {"ingest.implicit_missions", Type::boolean, "true", 0, 0, "",
     "open a mission for a robot that sends telemetry without an announced mission"},
    {"ingest.max_unknown_robots", Type::integer, "100", 0, 1000000, "",
     "robot ids without a model that have counters of their own, discarded after a minute without messages; "
     "robots with a model are always counted"},
    {"ingest.reorder_s", Type::number, "0.5", 0, 60, "s",
     "time that samples wait for a missing earlier one, to be accounted in order; 0: no waiting"},
    {"ingest.sender_takeover_s", Type::number, "2", 0.1, 3600, "s",
     "time without messages of a robot's sender after which another sender with the same robot_id is "
     "accepted at the latest; until then its messages wait, and are rejected if the first sender resumes"},
    {"ingest.max_clock_ahead_s", Type::number, "300", 0, 1e9, "s",
     "accepted lead of the time of samples and events over the host's clock; beyond: rejected"},
    {"ingest.booked_time_margin_s", Type::number, "60", 0, 86400, "s",
     "accepted lead of a robot's time over the host's after the robot's clock was set within a mission; "
     "samples beyond are rejected"},
    {"ingest.event_rate_hz", Type::number, "5", 0.01, 10000, "Hz",
     "mission events per second of one robot, in addition to a burst of 100 and one for each five samples; "
     "others are rejected"},

    {"robots.most", Type::integer, "10000", 1, 1e6, "",
     "robots with a model; beyond: PUT of a further robot is rejected, files of robots.directory are "
     "accepted"},
    {"robots.directory", Type::text, "", 0, 0, "",
     "directory of robot files (*.json) that are loaded at start; empty: none"},
    {"energy_state.period_s", Type::number, "1", 0.05, 3600, "s",
     "period of each robot's energy state on LCM"},
    {"meter.tolerance", Type::number, "1e-4", 1e-9, 1e-2, "",
     "local error of the energy integration, as a fraction of the energy between two samples"},

    {"adoption.max_missions", Type::integer, "50", 1, 1000, "",
     "largest number of missions in the back-test of a new model, newest first"},
    {"adoption.max_samples", Type::integer, "400000", 1000, 1e7, "",
     "largest number of samples in the back-test of a new model, which take some seconds"},
    {"adoption.automatic", Type::boolean, "false", 0, 0, "",
     "adopt models proposed by missions without confirmation if the back-test shows an improvement"},

    {"diagnosis.queue", Type::integer, "32", 1, 10000, "", "waiting diagnoses; beyond: 503"},
    {"diagnosis.max_missions", Type::integer, "200", 1, 1000, "",
     "largest number of missions of one diagnosis, newest first"},
    {"diagnosis.max_samples", Type::integer, "500000", 1000, 1e7, "",
     "largest number of samples of one diagnosis; bounds its memory (about 0.5 kB per sample) and time"},
    {"diagnosis.max_memory_bytes", Type::integer, "1073741824", 67108864, 1e12, "B",
     "memory of a diagnosis, which is a process of its own; beyond: the diagnosis fails"},
    {"diagnosis.deadline_s", Type::number, "3600", 1, 604800, "s",
     "duration beyond which a running diagnosis fails"},
    {"watch.period_s", Type::number, "3600", 0, 31536000, "s",
     "period at which the missions of every robot are examined for a drift of the gap; 0: never"},
    {"watch.robots", Type::text, "", 0, 0, "", "robots to watch, separated by commas; empty: all"},
    {"watch.least_change", Type::number, "0.01", 0.001, 1, "",
     "smallest change of measured over modelled energy that is a drift"},
    {"watch.diagnose", Type::boolean, "true", 0, 0, "", "start a diagnosis when a drift is detected"},

    {"metrics.robots", Type::integer, "200", 0, 10000, "",
     "robots with their own metrics at /metrics, the first by id, about 25 series each; 0: none"},

    {"log.format", Type::choice, "text", 0, 0, "",
     "format of log lines: text for a terminal, or json, one object per line", log_formats},
    {"log.level", Type::choice, "info", 0, 0, "", "lowest level that is written", log_levels},
};

}  // namespace

std::span<const Setting> settings_table() {
  return table;
}

}  // namespace joulecast
