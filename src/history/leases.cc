#include "history/leases.h"

#include <nlohmann/json.hpp>
#include <string_view>

#include "history/postgres.h"
#include "history/sql_rows.h"

namespace joulecast::history {
namespace {

// Nothing here may wait for a lock for long: the membership must be renewed.
constexpr const char* session_limits =
    "SET lock_timeout = '1s'; SET statement_timeout = '3s'; SET synchronous_commit = on";

// Robots are given as a JSON array of names.
constexpr std::string_view members =
    "SELECT node, incarnation, writer, address, version, CAST(extract(epoch FROM clock_timestamp() - joined) "
    "AS double precision), CAST(extract(epoch FROM expires - clock_timestamp()) AS double precision), "
    "server_started <> pg_postmaster_start_time() OR EXISTS (SELECT 1 FROM pg_stat_activity WHERE pid = "
    "backend_pid AND coalesce(backend_start, backend_started) = backend_started) FROM cluster_node ORDER BY "
    "node";
constexpr std::string_view hearings =
    "SELECT node, robot_id, CAST(extract(epoch FROM clock_timestamp() - since) AS double precision) FROM "
    "cluster_hears";
constexpr std::string_view leases =
    "SELECT robot_id, coalesce(node, ''), epoch, CAST(extract(epoch FROM clock_timestamp() - taken) AS "
    "double precision), takeovers, utime_us, sequence FROM cluster_lease";

Lease read_lease(Rows& rows) {
  Lease lease;
  std::optional<std::int64_t> utime_us, sequence;
  read_values(rows, lease.robot_id, lease.node, lease.epoch, lease.taken_s, lease.takeovers, utime_us,
              sequence);
  if (utime_us && sequence) lease.position = StreamPosition{*utime_us, *sequence};
  return lease;
}

std::vector<Member> read_members(Database& database) {
  std::vector<Member> all;
  for (Rows rows(database, members); rows.next();) {
    Member& each = all.emplace_back();
    read_values(rows, each.node, each.incarnation, each.writer, each.address, each.version, each.joined_s,
                each.expires_in_s, each.connected);
  }
  return all;
}

}  // namespace

OwnConnection::OwnConnection(std::string url, std::string name, std::string settings)
    : url_(std::move(url)), name_(std::move(name)), settings_(std::move(settings)) {}

OwnConnection::~OwnConnection() = default;

Database& OwnConnection::connected() {
  if (!database_ || !database_->is_usable()) {
    database_.reset();
    database_ = std::make_unique<PostgresDatabase>(url_, name_);
    database_->execute(settings_);
  }
  return *database_;
}

Leases::Leases(LeaseOptions options)
    : OwnConnection(options.url, options.writer + "-leases", session_limits), options_(std::move(options)) {}

Result<void> Leases::join() {
  return work([&](Database& database) -> Result<void> {
    Transaction transaction(database, Database::Access::write);
    database.execute("SELECT pg_advisory_xact_lock(1246512982, hashtext(current_schema()))");
    for (const Member& other : read_members(database)) {
      const bool is_alive = other.expires_in_s > 0 && other.connected;
      if (other.node == options_.node && other.writer != options_.writer && is_alive)
        return fail(Fault::conflict, "cluster.node",
                    "'" + options_.node + "' is the name of another daemon of the cluster");
    }
    {
      Rows others(
          database,
          "SELECT cluster FROM cluster_node WHERE cluster <> ? AND expires > clock_timestamp() LIMIT 1",
          options_.cluster);
      if (others.next())
        return fail(Fault::conflict, "cluster.name",
                    "the daemons that share this store are called '" + others.text() + "'");
    }
    Rows(database, "DELETE FROM cluster_node WHERE node = ? OR cluster <> ?", options_.node, options_.cluster)
        .run();
    incarnation_ = database.integer("SELECT nextval('cluster_incarnation')");
    Rows(database,
         "INSERT INTO cluster_node VALUES (?, ?, ?, ?, ?, ?, clock_timestamp(), clock_timestamp() + ? * "
         "interval '1 ms', pg_postmaster_start_time(), pg_backend_pid(), (SELECT backend_start FROM "
         "pg_stat_activity WHERE pid = pg_backend_pid()))",
         options_.node, options_.cluster, incarnation_, options_.writer, options_.address, options_.version,
         options_.lifetime.count())
        .run();
    // Missions that a daemon without a cluster left open are somebody's.
    database.execute(
        "INSERT INTO cluster_lease SELECT DISTINCT robot_id, NULL, 0, clock_timestamp(), 0 FROM mission "
        "WHERE state = 'open' ON CONFLICT DO NOTHING");
    transaction.commit();
    return {};
  });
}

Result<void> Leases::renew() {
  return work([&](Database& database) -> Result<void> {
    const std::int64_t renewed =
        Rows(database,
             "UPDATE cluster_node SET expires = clock_timestamp() + ? * interval '1 ms', server_started = "
             "pg_postmaster_start_time(), backend_pid = pg_backend_pid(), backend_started = (SELECT "
             "backend_start FROM pg_stat_activity WHERE pid = pg_backend_pid()) WHERE node = ? AND "
             "incarnation = ?",
             options_.lifetime.count(), options_.node, incarnation_)
            .run();
    if (renewed == 1) return {};
    return fail(Fault::conflict, "cluster.node", "the membership was ended by another daemon");
  });
}

Result<ClusterState> Leases::state() {
  return work([&](Database& database) -> Result<ClusterState> {
    ClusterState state;
    state.members = read_members(database);
    for (Rows rows(database, hearings); rows.next();) {
      Hearing& each = state.hearings.emplace_back();
      read_values(rows, each.node, each.robot_id, each.since_s);
    }
    for (Rows rows(database, leases); rows.next();) state.leases.push_back(read_lease(rows));
    return state;
  });
}

Result<bool> Leases::bury(const Member& member) {
  return work([&](Database& database) -> Result<bool> {
    // Ends transactions that it left open, too, which would hold its leases' rows.
    Rows(database, "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = ?",
         member.writer)
        .run();
    return Rows(database,
                "DELETE FROM cluster_node WHERE node = ?1 AND incarnation = ?2 AND (expires < "
                "clock_timestamp() OR server_started = pg_postmaster_start_time() AND NOT EXISTS (SELECT 1 "
                "FROM pg_stat_activity WHERE pid = backend_pid AND coalesce(backend_start, "
                "backend_started) = backend_started))",
                member.node, member.incarnation)
               .run() == 1;
  });
}

Result<void> Leases::hear(const std::vector<std::string>& more, const std::vector<std::string>& no_longer) {
  return work([&](Database& database) -> Result<void> {
    const std::string added = nlohmann::json(more).dump(), removed = nlohmann::json(no_longer).dump();
    if (!no_longer.empty())
      Rows(database,
           "DELETE FROM cluster_hears WHERE node = ? AND robot_id IN (SELECT "
           "json_array_elements_text(?::json))",
           options_.node, removed)
          .run();
    if (!more.empty())
      Rows(database,
           "INSERT INTO cluster_hears SELECT ?, json_array_elements_text(?::json), clock_timestamp() ON "
           "CONFLICT DO NOTHING",
           options_.node, added)
          .run();
    return {};
  });
}

Result<std::vector<Lease>> Leases::take(const std::vector<Lease>& seen) {
  return work([&](Database& database) -> Result<std::vector<Lease>> {
    std::vector<Lease> taken;
    for (const Lease& lease : seen) {
      if (lease.epoch == 0)
        Rows(database,
             "INSERT INTO cluster_lease VALUES (?, NULL, 0, clock_timestamp(), 0) ON CONFLICT DO NOTHING",
             lease.robot_id)
            .run();
      // It is free when released, or when its member is gone.
      Rows rows(
          database,
          "UPDATE cluster_lease SET node = ?1, epoch = epoch + 1, taken = clock_timestamp(), takeovers = "
          "takeovers + (node IS NOT NULL)::int WHERE robot_id = ?2 AND epoch = ?3 AND (node IS NULL OR "
          "node = ?1 OR NOT EXISTS (SELECT 1 FROM cluster_node WHERE cluster_node.node = "
          "cluster_lease.node)) AND EXISTS (SELECT 1 FROM cluster_node WHERE node = ?1 AND incarnation = "
          "?4) RETURNING robot_id, node, epoch, 0::double precision, takeovers, utime_us, sequence",
          options_.node, lease.robot_id, lease.epoch, incarnation_);
      if (rows.next()) taken.push_back(read_lease(rows));
    }
    return taken;
  });
}

Result<void> Leases::free(const std::vector<Lease>& seen) {
  return work([&](Database& database) -> Result<void> {
    for (const Lease& lease : seen)
      Rows(database, "UPDATE cluster_lease SET node = NULL WHERE robot_id = ? AND node = ? AND epoch = ?",
           lease.robot_id, options_.node, lease.epoch)
          .run();
    return {};
  });
}

Result<std::vector<std::int64_t>> Leases::take_jobs() {
  return work([&](Database& database) -> Result<std::vector<std::int64_t>> {
    std::vector<std::int64_t> taken;
    Rows rows(database,
              "UPDATE cluster_job SET writer = ? WHERE diagnosis_id IN (SELECT diagnosis_id FROM "
              "cluster_job WHERE NOT EXISTS (SELECT 1 FROM cluster_node WHERE cluster_node.writer = "
              "cluster_job.writer) FOR UPDATE SKIP LOCKED) RETURNING diagnosis_id",
              options_.writer);
    while (rows.next()) taken.push_back(rows.integer());
    return taken;
  });
}

Result<void> Leases::leave() {
  return work([&](Database& database) -> Result<void> {
    Rows(database, "DELETE FROM cluster_node WHERE node = ? AND incarnation = ?", options_.node, incarnation_)
        .run();
    return {};
  });
}

Result<void> SharedState::put(const std::vector<LiveState>& states) {
  return work([&](Database& database) -> Result<void> {
    if (states.empty()) return {};
    Transaction transaction(database, Database::Access::write);
    for (const LiveState& state : states) {
      Rows rows(
          database,
          "INSERT INTO cluster_live AS old VALUES (?1, ?2, ?3, 1, ?4) ON CONFLICT (robot_id) DO UPDATE SET "
          "node = ?2, epoch = ?3, number = old.number + 1, body = ?4 WHERE old.epoch <= ?3",
          state.robot_id, state.node, state.epoch, std::span<const std::byte>(state.body));
      rows.run_later();
    }
    transaction.commit();
    return {};
  });
}

Result<std::vector<LiveState>> SharedState::news(const std::string& own_node) {
  return work([&](Database& database) -> Result<std::vector<LiveState>> {
    std::vector<std::string> changed;
    std::map<std::string, Mark> marks;
    {
      Rows rows(database, "SELECT robot_id, epoch, number FROM cluster_live WHERE node <> ?", own_node);
      while (rows.next()) {
        std::string robot_id;
        Mark mark;
        read_values(rows, robot_id, mark.epoch, mark.number);
        const auto seen = seen_.find(robot_id);
        if (seen == seen_.end() || seen->second != mark) changed.push_back(robot_id);
        marks.emplace(std::move(robot_id), mark);
      }
    }
    std::vector<LiveState> news;
    if (!changed.empty()) {
      const std::string names = nlohmann::json(changed).dump();
      Rows rows(database,
                "SELECT robot_id, node, epoch, body FROM cluster_live WHERE node <> ? AND robot_id IN "
                "(SELECT json_array_elements_text(?::json))",
                own_node, names);
      while (rows.next()) {
        LiveState& state = news.emplace_back();
        read_values(rows, state.robot_id, state.node, state.epoch);
        const auto body = rows.blob();
        state.body.assign(body.begin(), body.end());
      }
    }
    seen_ = std::move(marks);
    return news;
  });
}

Result<std::map<std::string, std::optional<std::int64_t>>> SharedState::active_models() {
  return work([&](Database& database) -> Result<std::map<std::string, std::optional<std::int64_t>>> {
    Rows rows(database, "SELECT robot_id, active_version FROM robot");
    return read_by_name<std::map<std::string, std::optional<std::int64_t>>>(rows);
  });
}

Result<std::map<std::string, std::int64_t>> SharedState::learned(const std::string& topic) {
  return work([&](Database& database) -> Result<std::map<std::string, std::int64_t>> {
    Rows rows(database, "SELECT robot_id, utime_us FROM learned WHERE topic = ?", topic);
    return read_by_name<std::map<std::string, std::int64_t>>(rows);
  });
}

}  // namespace joulecast::history
