
#include "server/settings.h"

namespace joulecast {
namespace {

constexpr std::string_view store_synchronous[] = {"full", "normal"};
constexpr std::string_view log_formats[] = {"text", "json"};
constexpr std::string_view log_levels[] = {"debug", "info", "warning", "error"};
constexpr std::string_view mqtt_dialects[] = {"vda5050-3.0", "vda5050-2.1"};
constexpr double megabyte = 1024.0 * 1024.0;
constexpr double us_per_day = 86400e6;

#define MEMBER(member) [](DaemonOptions& o) { return target(o.member); }
#define DURATION(member) [](DaemonOptions& o) { return duration(o.member); }
#define LIMIT(member, unit) [](DaemonOptions& o) { return limit(o.member, unit); }

// key, member, minimum, maximum, unit, help
constexpr Setting table[] = {
    {"lcm.url", MEMBER(ingest.lcm_url), 0, 0, "",
     "LCM provider. ttl limits the range of sent messages, not of received ones; recv_buf_size requests a "
     "receive buffer of that many bytes from the kernel, at most net.core.rmem_max"},
    {"lcm.bind_address", MEMBER(ingest.listen.interface_address), 0, 0, "",
     "IPv4 address of the interface to receive on; empty: the interface that the system routes the multicast "
     "group to"},
    {"lcm.accept_from", MEMBER(ingest.listen.accept_from), 0, 0, "",
     "accepted senders of datagrams, separated by commas: networks such as 10.1.0.0/16, addresses, any, or "
     "local, which is loopback and the networks of this host's interfaces; datagrams of other senders are "
     "counted"},

    {"http.address", MEMBER(http.address), 0, 0, "",
     "IP address to listen on; an address other than loopback needs auth.token_file or http.insecure"},
    {"http.tls_certificate", MEMBER(http.tls.certificate), 0, 0, "",
     "PEM file of the certificate and its chain, read again at SIGHUP; with http.tls_key: HTTPS only, TLS "
     "1.2 or newer"},
    {"http.tls_key", MEMBER(http.tls.key), 0, 0, "", "PEM file of the certificate's private key"},
    {"http.tls_client_authorities", MEMBER(http.tls.client_authorities), 0, 0, "",
     "PEM file of certificate authorities; only clients with a certificate of one of them are accepted"},
    {"http.insecure", MEMBER(insecure), 0, 0, "",
     "allow unauthenticated access, with all permissions, on an address other than loopback"},
    {"http.port", MEMBER(http.port), 0, 65535, "", "port to listen on; 0 lets the system choose"},
    {"http.allowed_hosts", MEMBER(http.allowed_hosts), 0, 0, "",
     "host names accepted in requests, separated by commas, in addition to IP addresses, localhost and this "
     "host's name; *: any; others: 421"},
    {"http.trusted_proxies", MEMBER(http.trusted_proxies), 0, 0, "",
     "IP addresses of reverse proxies, separated by commas; their X-Forwarded-For determines the client "
     "address for the audit log and the limits per client, their X-Forwarded-Proto the use of HTTPS"},
    {"http.allowed_origins", MEMBER(http.allowed_origins), 0, 0, "",
     "origins of other sites from which browsers may use the service, such as https://fleet.example, "
     "separated by commas; empty: none"},
    {"http.worker_threads", MEMBER(http.worker_threads), 1, 64, "",
     "threads for requests that read the store"},
    {"http.compute_threads", MEMBER(http.compute_threads), 1, 64, "", "threads for requests that compute"},
    {"http.worker_queue", MEMBER(http.worker_queue), 1, 65536, "",
     "requests that may wait for threads of one kind; beyond: 503"},
    {"http.client_requests", MEMBER(http.client_requests), 1, 65536, "",
     "requests of one client, which is a token or an address without one, that may wait or compute; beyond: "
     "429"},
    {"http.request_deadline_s", MEMBER(http.request_deadline), 0.1, 86400, "s",
     "waiting and computing time of one request; beyond: 503, and the request is cancelled unless it has "
     "begun a change"},
    {"http.max_connections", MEMBER(http.max_connections), 1, 100000, "",
     "open connections; beyond: of the address with the most, a connection that is idle or has not sent its "
     "whole request is closed, or else 503"},
    {"http.client_connections", MEMBER(http.client_connections), 1, 100000, "",
     "connections of one client address; beyond: its longest idle one is closed, or else 503"},
    {"http.max_header_bytes", MEMBER(http.max_header_bytes), 1024, 1048576, "B",
     "request line and headers; beyond: 431"},
    {"http.max_body_bytes", MEMBER(http.max_body_bytes), 1024, 256 * megabyte, "B",
     "request body; beyond: 413"},
    {"http.max_bodies_bytes", MEMBER(http.max_bodies_bytes), 1024, 64 * 1024 * megabyte, "B",
     "bodies of all unanswered requests, at most a quarter for one client; beyond: 429, or the largest body "
     "of the largest client is cut off, or else 503"},
    {"http.read_timeout_s", MEMBER(http.read_timeout), 0.1, 3600, "s",
     "time from the first to the last byte of a request"},
    {"http.write_timeout_s", MEMBER(http.write_timeout), 0.1, 3600, "s",
     "time without progress in sending an answer"},
    {"http.idle_timeout_s", MEMBER(http.idle_timeout), 0.1, 86400, "s",
     "time between two requests of a connection"},
    {"http.stop_deadline_s", MEMBER(stop_deadline), 0, 600, "s",
     "time for running requests to finish at shutdown"},
    {"http.event_queue_bytes", MEMBER(events.queue_bytes), 4096, 64 * megabyte, "B",
     "unsent events for a client of the event stream; beyond: the client is disconnected. Of a robot's "
     "states only the newest is queued, about 2 kB"},
    {"http.event_streams", MEMBER(events.max_subscribers), 1, 100000, "",
     "open event streams, at most a quarter for one client; beyond: the oldest stream of the largest client "
     "is closed, or else 503"},
    {"http.web_directory", MEMBER(web_directory), 0, 0, "",
     "directory of the operator page; empty: the built-in page"},

    {"auth.token_file", MEMBER(token_file), 0, 0, "",
     "file of the tokens that authenticate requests, made by joulecast token create and read again when it "
     "changes; empty: no authentication"},

    {"webhooks.file", MEMBER(webhooks_file), 0, 0, "",
     "file of the URLs that receive events, see operations.md; empty: none"},
    {"webhooks.queue", MEMBER(webhooks.queue), 1, 1000000, "",
     "events queued for one URL; beyond: the oldest is dropped and counted"},

    {"mqtt.url", MEMBER(mqtt_url), 0, 0, "",
     "MQTT broker to which the batteries of live robots are published, mqtt://host[:port] or "
     "mqtts://host[:port]; empty: none"},
    {"mqtt.authorities", MEMBER(mqtt.broker.authorities), 0, 0, "",
     "PEM file of the certificate authorities of the broker's certificate; empty: those of the system"},
    {"mqtt.user", MEMBER(mqtt.broker.user), 0, 0, "", "user name at the broker; empty: none"},
    {"mqtt.password_file", MEMBER(mqtt_password_file), 0, 0, "",
     "file of this user's password, readable only by its owner; requires mqtt.user"},
    {"mqtt.client_id", MEMBER(mqtt.broker.client_id), 0, 0, "",
     "MQTT client identifier, unique among the clients of the broker"},
    {"mqtt.interface", MEMBER(mqtt.interface), 0, 0, "",
     "first level of the topics, the interface name of VDA 5050; not the one that the robots use"},
    {"mqtt.manufacturer", MEMBER(mqtt.manufacturer), 0, 0, "",
     "manufacturer of the robots, a level of the topics"},
    {"mqtt.dialect", [](DaemonOptions& o) { return choice(o.mqtt.dialect, mqtt_dialects, 1); }, 0, 0, "",
     "format of the messages"},
    {"mqtt.period_s", MEMBER(mqtt.period), 0.5, 3600, "s",
     "time between two publications of a robot's battery"},

    {"store.path", MEMBER(store_path), 0, 0, "",
     "SQLite file of the history; data that are not committed at shutdown are kept in PATH.spool"},
    {"store.url", MEMBER(store_url), 0, 0, "",
     "database of the history: sqlite:PATH or postgresql://user@host1,host2/database; empty: sqlite: and "
     "store.path"},
    {"store.synchronous", [](DaemonOptions& o) { return choice(o.store.durability, store_synchronous); }, 0,
     0, "",
     "durability of a commit to the SQLite file: full survives a loss of power; normal, for slow disks, "
     "survives a crash of the daemon only"},
    {"store.retention_days", LIMIT(writer.retention.telemetry_max_age_us, us_per_day), 0, 36500, "d",
     "age at which raw telemetry is deleted, at most 5 % of it per hour; 0: never"},
    {"store.retention_bytes", LIMIT(writer.retention.telemetry_max_bytes, 1), 0, 1e15, "B",
     "size of raw telemetry beyond which the oldest is deleted; 0: no limit"},
    {"store.retention_missions_days", LIMIT(writer.missions_max_age_us, us_per_day), 0, 36500, "d",
     "time since the end of a mission, by the robot's clock, after which the mission and all its data are "
     "deleted, at most 5 % of the missions per hour; 0: never"},
    {"store.retention_events", LIMIT(writer.events_kept, 1), 0, 1e12, "",
     "stored events; beyond: the oldest are deleted; 0: no limit"},
    {"store.retention_audit_days", LIMIT(writer.audit_max_age_us, us_per_day), 0, 36500, "d",
     "age at which entries of the audit are deleted, in whole days, at most 5 % of them per hour; an entry "
     "with their number and last hash keeps the chain verifiable; 0: never"},
    {"store.queue_bytes", MEMBER(writer.queue_bytes), 1048576, 1e12, "B",
     "memory for data waiting for the store; beyond: raw samples are discarded and counted"},

    {"cluster.name", MEMBER(cluster.name), 0, 0, "",
     "name of the cluster of daemons that share the fleet and the PostgreSQL of store.url; empty: no "
     "cluster, this daemon keeps every robot that it receives"},
    {"cluster.node", MEMBER(cluster.node), 0, 0, "",
     "this daemon's name, unique in the cluster; empty: the host's name"},
    {"cluster.lease_s", MEMBER(cluster.lifetime), 2, 60, "s",
     "time without contact to PostgreSQL after which other daemons of the cluster take over this one's "
     "robots; the robots of a terminated daemon are taken over without this delay"},

    {"ingest.key_file", MEMBER(ingest.signatures.key_file), 0, 0, "",
     "file of the robots' signing keys, made by joulecast key create and read again when it changes; of a "
     "robot with a key only signed messages are accepted; empty: no keys"},
    {"ingest.require_signed", MEMBER(ingest.signatures.required), 0, 0, "",
     "reject also robots without a key"},
    {"ingest.signature_age_s", DURATION(ingest.signatures.max_age_us), 0.1, 86400, "s",
     "accepted difference between the time of a signed message and the host's clock; others are rejected as "
     "replayed"},
    {"ingest.queue_messages", MEMBER(ingest.queue_messages), 1000, 1e8, "",
     "received messages waiting to be accounted; beyond: dropped and counted"},
    {"ingest.gap_bridge_s", MEMBER(ingest.session.meter.gap_bridge_s), 0, 3600, "s",
     "longest time between two samples that is interpolated at any rate; in a faster stream ten sample "
     "periods, and at least 1 s, are interpolated. A longer time is a gap and marks the mission incomplete"},
    {"ingest.mission_idle_timeout_s", DURATION(ingest.session.mission.explicit_silence_us), 1, 86400, "s",
     "silence after which an unfinished mission is closed as abandoned"},
    {"ingest.implicit_missions", MEMBER(ingest.session.implicit_missions), 0, 0, "",
     "open a mission for a robot that sends telemetry without an announced mission"},
    {"ingest.max_unknown_robots", MEMBER(ingest.max_unknown_robots), 0, 1000000, "",
     "robot ids without a model that have counters of their own, discarded after a minute without messages; "
     "robots with a model are always counted"},
    {"ingest.reorder_s", DURATION(ingest.session.reorder_us), 0, 60, "s",
     "time that samples wait for a missing earlier one, to be accounted in order; 0: no waiting"},
    {"ingest.sender_takeover_s", DURATION(ingest.session.sender_takeover_us), 0.1, 3600, "s",
     "time without messages of a robot's sender after which another sender with the same robot_id is "
     "accepted at the latest; until then its messages wait, and are rejected if the first sender resumes"},
    {"ingest.max_clock_ahead_s", DURATION(ingest.session.max_ahead_us), 0, 1e9, "s",
     "accepted lead of the time of samples and events over the host's clock; beyond: rejected"},
    {"ingest.booked_time_margin_s", DURATION(ingest.session.booked_margin_us), 0, 86400, "s",
     "accepted lead of a robot's time over the host's after the robot's clock was set within a mission; "
     "samples beyond are rejected"},
    {"ingest.event_rate_hz", MEMBER(ingest.session.event_rate_hz), 0.01, 10000, "Hz",
     "mission events per second of one robot, in addition to a burst of 100 and one for each five samples; "
     "others are rejected"},

    {"robots.most", MEMBER(adoption.most_robots), 1, 1e6, "",
     "robots with a model; beyond: PUT of a further robot is rejected, files of robots.directory are "
     "accepted"},
    {"robots.directory", MEMBER(robots_directory), 0, 0, "",
     "directory of robot files (*.json) that are loaded at start; empty: none"},

    {"energy_state.period_s", MEMBER(ingest.energy_state_period), 0.05, 3600, "s",
     "period of each robot's energy state on LCM"},

    {"meter.tolerance", MEMBER(ingest.session.meter.tolerance), 1e-9, 1e-2, "",
     "local error of the energy integration, as a fraction of the energy between two samples"},

    {"adoption.max_missions", MEMBER(adoption.max_missions), 1, 1000, "",
     "largest number of missions in the back-test of a new model, newest first"},
    {"adoption.max_samples", MEMBER(adoption.max_samples), 1000, 1e7, "",
     "largest number of samples in the back-test of a new model, which take some seconds"},
    {"adoption.automatic", MEMBER(adopts_automatically), 0, 0, "",
     "adopt models proposed by missions without confirmation if the back-test shows an improvement"},

    {"diagnosis.queue", MEMBER(diagnosis.queue), 1, 10000, "", "waiting diagnoses; beyond: 503"},
    {"diagnosis.max_missions", MEMBER(diagnosis.max_missions), 1, 1000, "",
     "largest number of missions of one diagnosis, newest first"},
    {"diagnosis.max_samples", MEMBER(diagnosis.max_samples), 1000, 1e7, "",
     "largest number of samples of one diagnosis; bounds its memory (about 0.5 kB per sample) and time"},
    {"diagnosis.max_memory_bytes", MEMBER(diagnosis.max_memory_bytes), 67108864, 1e12, "B",
     "memory of a diagnosis, which is a process of its own; beyond: the diagnosis fails"},
    {"diagnosis.deadline_s", MEMBER(diagnosis.deadline), 1, 604800, "s",
     "duration beyond which a running diagnosis fails"},

    {"watch.period_s", MEMBER(watch.period_s), 0, 31536000, "s",
     "period at which the missions of every robot are examined for a drift of the gap; 0: never"},
    {"watch.robots", MEMBER(watch.robots), 0, 0, "", "robots to watch, separated by commas; empty: all"},
    {"watch.least_change", MEMBER(drift.settings.least_change), 0.001, 1, "",
     "smallest change of measured over modelled energy that is a drift"},
    {"watch.diagnose", MEMBER(watch.diagnose), 0, 0, "", "start a diagnosis when a drift is detected"},

    {"energy.price_per_kwh", MEMBER(price_per_kwh), 0, 1e6, "",
     "price of a kilowatt hour, by which the page values energy; 0: none is shown"},
    {"energy.currency", MEMBER(currency), 0, 0, "", "currency of energy.price_per_kwh"},
    {"energy.co2_g_per_kwh", MEMBER(co2_g_per_kwh), 0, 1e6, "g",
     "carbon dioxide emitted for a kilowatt hour, by which the page values energy; 0: none is shown"},

    {"metrics.robots", MEMBER(robots_with_metrics), 0, 10000, "",
     "robots with their own metrics at /metrics, the first by id, about 25 series each; 0: none"},

    {"log.format", [](DaemonOptions& o) { return choice(o.log_format, log_formats); }, 0, 0, "",
     "format of log lines: text for a terminal, or json, one object per line"},
    {"log.level", [](DaemonOptions& o) { return choice(o.log_level, log_levels); }, 0, 0, "",
     "lowest level that is written"},
};

#undef MEMBER
#undef DURATION
#undef LIMIT

}  // namespace

std::span<const Setting> settings_table() {
  return table;
}

}  // namespace joulecast
