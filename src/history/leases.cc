#include "history/leases.h"

#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "history/postgres.h"
#include "history/sql_store.h"

namespace joulecast::history {
namespace {

// Nothing here may wait for a lock for long: the membership must be renewed.
constexpr const char* session_limits =
    "SET lock_timeout = '1s'; SET statement_timeout = '3s'; SET synchronous_commit = on";

// Robots are given as a JSON array of names.
constexpr std::string_view members =
    "SELECT node, incarnation, writer, address, version, "
    "CAST(extract(epoch FROM clock_timestamp() - joined) AS double precision), "
    "CAST(extract(epoch FROM expires - clock_timestamp()) AS double precision), "
    "server_started <> pg_postmaster_start_time() OR EXISTS (SELECT 1 FROM pg_stat_activity WHERE pid = "
    "backend_pid AND coalesce(backend_start, backend_started) = backend_started) FROM cluster_node ORDER BY "
    "node";
constexpr std::string_view hearings =
    "SELECT node, robot_id, CAST(extract(epoch FROM clock_timestamp() - since) AS double precision) "
    "FROM cluster_hears";
constexpr std::string_view leases =
    "SELECT robot_id, coalesce(node, ''), epoch, "
    "CAST(extract(epoch FROM clock_timestamp() - taken) AS double precision), takeovers, "
    "utime_us, sequence FROM cluster_lease";

Lease read_lease(Rows& rows) {
  Lease lease;
  lease.robot_id = rows.text();
  lease.node = rows.text();
  lease.epoch = rows.integer();
  lease.taken_s = rows.real();
  lease.takeovers = rows.integer();
  const auto utime_us = rows.optional_integer(), sequence = rows.optional_integer();
  if (utime_us && sequence) lease.position = StreamPosition{*utime_us, *sequence};
  return lease;
}

class PostgresLeases final : public Leases {
 public:
  explicit PostgresLeases(LeaseOptions options) : options_(std::move(options)) {}

  Result<void> join() override {
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
        Rows others(database.statement(
            "SELECT cluster FROM cluster_node WHERE cluster <> ? AND expires > clock_timestamp() LIMIT 1"));
        others.bind(options_.cluster);
        if (others.next())
          return fail(Fault::conflict, "cluster.name",
                      "the daemons that share this store are called '" + others.text() + "'");
      }
      Rows(database.statement("DELETE FROM cluster_node WHERE node = ? OR cluster <> ?"))
          .bind(options_.node)
          .bind(options_.cluster)
          .run();
      incarnation_ = database.integer("SELECT nextval('cluster_incarnation')");
      Rows(
          database.statement(
              "INSERT INTO cluster_node VALUES (?, ?, ?, ?, ?, ?, clock_timestamp(), clock_timestamp() + ? * "
              "interval '1 ms', pg_postmaster_start_time(), pg_backend_pid(), (SELECT backend_start FROM "
              "pg_stat_activity WHERE pid = pg_backend_pid()))"))
          .bind(options_.node)
          .bind(options_.cluster)
          .bind(incarnation_)
          .bind(options_.writer)
          .bind(options_.address)
          .bind(options_.version)
          .bind(options_.lifetime.count())
          .run();
      // Missions that a daemon without a cluster left open are somebody's.
      database.execute(
          "INSERT INTO cluster_lease SELECT DISTINCT robot_id, NULL, 0, clock_timestamp(), 0 FROM mission "
          "WHERE state = 'open' ON CONFLICT DO NOTHING");
      transaction.commit();
      return {};
    });
  }

  Result<void> renew() override {
    return work([&](Database& database) -> Result<void> {
      const std::int64_t renewed =
          Rows(database.statement(
                   "UPDATE cluster_node SET expires = clock_timestamp() + ? * interval '1 ms', "
                   "server_started = "
                   "pg_postmaster_start_time(), backend_pid = pg_backend_pid(), backend_started = (SELECT "
                   "backend_start FROM pg_stat_activity WHERE pid = pg_backend_pid()) WHERE node = ? AND "
                   "incarnation = ?"))
              .bind(options_.lifetime.count())
              .bind(options_.node)
              .bind(incarnation_)
              .run();
      if (renewed == 1) return {};
      return fail(Fault::conflict, "cluster.node", "the membership was ended by another daemon");
    });
  }

  Result<ClusterState> state() override {
    return work([&](Database& database) -> Result<ClusterState> {
      ClusterState state;
      state.members = read_members(database);
      for (Rows rows(database.statement(hearings)); rows.next();) {
        Hearing& each = state.hearings.emplace_back();
        each.node = rows.text();
        each.robot_id = rows.text();
        each.since_s = rows.real();
      }
      for (Rows rows(database.statement(leases)); rows.next();) {
        state.leases.push_back(read_lease(rows));
      }
      return state;
    });
  }

  Result<bool> bury(const Member& member) override {
    return work([&](Database& database) -> Result<bool> {
      // Ends transactions that it left open, too, which would hold its leases' rows.
      Rows(database.statement(
               "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = ?"))
          .bind(member.writer)
          .run();
      return Rows(database.statement(
                      "DELETE FROM cluster_node WHERE node = ?1 AND incarnation = ?2 AND (expires < "
                      "clock_timestamp() OR server_started = pg_postmaster_start_time() AND NOT EXISTS "
                      "(SELECT "
                      "1 FROM pg_stat_activity WHERE pid = backend_pid AND coalesce(backend_start, "
                      "backend_started) = backend_started))"))
                 .bind(member.node)
                 .bind(member.incarnation)
                 .run() == 1;
    });
  }

  Result<void> hear(const std::vector<std::string>& more,
                    const std::vector<std::string>& no_longer) override {
    return work([&](Database& database) -> Result<void> {
      const std::string added = nlohmann::json(more).dump(), removed = nlohmann::json(no_longer).dump();
      if (!no_longer.empty())
        Rows(database.statement("DELETE FROM cluster_hears WHERE node = ? AND robot_id IN (SELECT "
                                "json_array_elements_text(?::json))"))
            .bind(options_.node)
            .bind(removed)
            .run();
      if (!more.empty())
        Rows(database.statement("INSERT INTO cluster_hears SELECT ?, json_array_elements_text(?::json), "
                                "clock_timestamp() ON CONFLICT DO NOTHING"))
            .bind(options_.node)
            .bind(added)
            .run();
      return {};
    });
  }

  Result<std::vector<Lease>> take(const std::vector<Lease>& seen) override {
    return work([&](Database& database) -> Result<std::vector<Lease>> {
      std::vector<Lease> taken;
      for (const Lease& lease : seen) {
        if (lease.epoch == 0)
          Rows(database.statement("INSERT INTO cluster_lease VALUES (?, NULL, 0, clock_timestamp(), 0) ON "
                                  "CONFLICT DO NOTHING"))
              .bind(lease.robot_id)
              .run();
        // It is free when released, or when its member is gone.
        Rows rows(database.statement(
            "UPDATE cluster_lease SET node = ?1, epoch = epoch + 1, taken = clock_timestamp(), takeovers = "
            "takeovers + (node IS NOT NULL)::int WHERE robot_id = ?2 AND epoch = ?3 AND (node IS NULL OR "
            "node = "
            "?1 OR NOT EXISTS (SELECT 1 FROM cluster_node WHERE cluster_node.node = cluster_lease.node)) AND "
            "EXISTS (SELECT 1 FROM cluster_node WHERE node = ?1 AND incarnation = ?4) RETURNING robot_id, "
            "node, "
            "epoch, 0::double precision, takeovers, utime_us, sequence"));
        rows.bind(options_.node).bind(lease.robot_id).bind(lease.epoch).bind(incarnation_);
        if (rows.next()) taken.push_back(read_lease(rows));
      }
      return taken;
    });
  }

  Result<void> free(const std::vector<Lease>& seen) override {
    return work([&](Database& database) -> Result<void> {
      for (const Lease& lease : seen)
        Rows(database.statement(
                 "UPDATE cluster_lease SET node = NULL WHERE robot_id = ? AND node = ? AND epoch = ?"))
            .bind(lease.robot_id)
            .bind(options_.node)
            .bind(lease.epoch)
            .run();
      return {};
    });
  }

  Result<std::vector<std::int64_t>> take_jobs() override {
    return work([&](Database& database) -> Result<std::vector<std::int64_t>> {
      std::vector<std::int64_t> taken;
      Rows rows(database.statement(
          "UPDATE cluster_job SET writer = ? WHERE diagnosis_id IN (SELECT diagnosis_id FROM cluster_job "
          "WHERE "
          "NOT EXISTS (SELECT 1 FROM cluster_node WHERE cluster_node.writer = cluster_job.writer) FOR UPDATE "
          "SKIP LOCKED) RETURNING diagnosis_id"));
      rows.bind(options_.writer);
      while (rows.next()) {
        taken.push_back(rows.integer());
      }
      return taken;
    });
  }

  Result<void> leave() override {
    return work([&](Database& database) -> Result<void> {
      Rows(database.statement("DELETE FROM cluster_node WHERE node = ? AND incarnation = ?"))
          .bind(options_.node)
          .bind(incarnation_)
          .run();
      return {};
    });
  }

 private:
  static std::vector<Member> read_members(Database& database) {
    std::vector<Member> all;
    for (Rows rows(database.statement(members)); rows.next();) {
      Member& each = all.emplace_back();
      each.node = rows.text();
      each.incarnation = rows.integer();
      each.writer = rows.text();
      each.address = rows.text();
      each.version = rows.text();
      each.joined_s = rows.real();
      each.expires_in_s = rows.real();
      each.connected = rows.boolean();
    }
    return all;
  }

  template <class Work>
  auto work(Work work) -> decltype(work(std::declval<Database&>())) {
    return guarded([&] {
      if (!database_ || !database_->is_usable()) {
        database_.reset();
        database_ = std::make_unique<PostgresDatabase>(options_.url, options_.writer + "-leases");
        database_->execute(session_limits);
      }
      return work(*database_);
    });
  }

  const LeaseOptions options_;
  std::unique_ptr<PostgresDatabase> database_;
  std::int64_t incarnation_ = 0;
};

}  // namespace

std::unique_ptr<Leases> open_leases(LeaseOptions options) {
  return std::make_unique<PostgresLeases>(std::move(options));
}

}  // namespace joulecast::history
