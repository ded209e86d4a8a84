#include "history/sqlite_changes.h"

#include <algorithm>
#include <string>
#include <utility>

#include "history/sqlite_rows.h"
#include "history/telemetry_chunk.h"

namespace joulecast::history {
namespace {

using telemetry::Sample;

// zstd levels: a tail chunk is soon written again, a sealed one is kept.
constexpr int tail_level = 1;
constexpr int sealed_level = 3;

tl::unexpected<Error> no_mission(MissionKey key) {
  return fail(Fault::not_found, "mission", "no mission has key " + std::to_string(key));
}

Result<void> check_robot_id(std::string_view robot_id) {
  if (robot_id.empty()) return invalid("robot_id", "must not be empty");
  return {};
}

Result<void> check_trace(const std::vector<TraceBucket>& trace) {
  for (std::size_t i = 0; i < trace.size(); ++i)
    if (trace[i].start_utime_us % trace_bucket_us != 0)
      return invalid("/trace/" + std::to_string(i) + "/start_utime_us",
                     std::to_string(trace[i].start_utime_us) + " is not a multiple of " +
                         std::to_string(trace_bucket_us));
  return {};
}

}  // namespace

SqliteChanges::SqliteChanges(Database& database, std::function<std::int64_t()> now_utime_us)
    : database_(database), now_utime_us_(std::move(now_utime_us)) {}

std::vector<Outcome> SqliteChanges::apply(std::span<const Command> commands) {
  std::vector<Outcome> outcomes;
  outcomes.reserve(commands.size());
  Transaction transaction(database_, Transaction::Kind::write);
  for (const Command& command : commands) outcomes.push_back(apply_whole(command));
  transaction.commit();
  return outcomes;
}

Outcome SqliteChanges::apply_whole(const Command& command) {
  Rows(database_.statement("SAVEPOINT command")).run();
  Outcome outcome = [&]() -> Outcome {
    try {
      return std::visit([this](const auto& c) { return run(c); }, command);
    } catch (const SqliteError& error) {
      if (!error.is_about_values()) throw;
      return invalid("", error.what());
    }
  }();
  if (!outcome) Rows(database_.statement("ROLLBACK TO command")).run();
  Rows(database_.statement("RELEASE command")).run();
  return outcome;
}

void SqliteChanges::make_robot(const std::string& robot_id) {
  Rows(database_.statement(
           "INSERT INTO robot (robot_id, created_utime_us) VALUES (?, ?) ON CONFLICT DO NOTHING"))
      .bind(robot_id)
      .bind(now_utime_us_())
      .run();
}

Outcome SqliteChanges::run(const AddModel& c) {
  if (auto ok = check_robot_id(c.robot_id); !ok) return tl::unexpected(ok.error());
  make_robot(c.robot_id);
  std::optional<std::int64_t> active;
  {
    Rows rows(database_.statement("SELECT active_version FROM robot WHERE robot_id = ?"));
    rows.bind(c.robot_id);
    if (rows.next()) active = rows.optional_integer();
  }
  if (c.expected_active && *c.expected_active != active.value_or(0))
    return fail(Fault::conflict, "model_version",
                "version " + std::to_string(active.value_or(0)) + " is active, not " +
                    std::to_string(*c.expected_active));
  if (active) {
    Rows same(database_.statement("SELECT model_json = ? FROM model WHERE robot_id = ? AND version = ?"));
    same.bind(c.model_json).bind(c.robot_id).bind(*active);
    if (same.next() && same.boolean()) return *active;
  }
  std::int64_t version = 1;
  {
    Rows rows(database_.statement("SELECT coalesce(max(version), 0) + 1 FROM model WHERE robot_id = ?"));
    rows.bind(c.robot_id);
    if (rows.next()) version = rows.integer();
  }
  Rows(database_.statement(
           "INSERT INTO model (robot_id, version, created_utime_us, origin, note, "
           "parent_version, model_json, evidence_json) VALUES (?, ?, ?, ?, ?, ?, ?, nullif(?, ''))"))
      .bind(c.robot_id)
      .bind(version)
      .bind(c.utime_us)
      .bind(name(c.origin))
      .bind(c.note)
      .bind(active)
      .bind(c.model_json)
      .bind(c.evidence_json)
      .run();
  return run(ActivateModel{c.robot_id, version});
}

Outcome SqliteChanges::run(const ActivateModel& c) {
  const std::int64_t changed =
      Rows(database_.statement("UPDATE robot SET active_version = ?1 WHERE robot_id = ?2 AND EXISTS "
                               "(SELECT 1 FROM model WHERE robot_id = ?2 AND version = ?1)"))
          .bind(c.version)
          .bind(c.robot_id)
          .run();
  if (changed == 0)
    return fail(Fault::not_found, "model_version",
                "robot '" + c.robot_id + "' has no model version " + std::to_string(c.version));
  return c.version;
}

Outcome SqliteChanges::run(const StartMission& c) {
  const Mission& m = c.mission;
  if (auto ok = check_robot_id(m.robot_id); !ok) return tl::unexpected(ok.error());
  if (m.key <= 0) return invalid("key", "must be one that mission_key() gave");
  make_robot(m.robot_id);
  {
    Rows rows(
        database_.statement("SELECT mission_key FROM mission WHERE (mission_key = ?1) <> "
                            "(robot_id = ?2 AND mission_id = ?3 AND start_utime_us = ?4) "
                            "AND (mission_key = ?1 OR robot_id = ?2 AND mission_id = ?3 AND "
                            "start_utime_us = ?4)"));
    bind_mission_identity(rows, m);
    if (rows.next())
      return fail(Fault::conflict, "key",
                  "key " + std::to_string(m.key) + " and mission '" + m.mission_id + "' of robot '" +
                      m.robot_id + "' do not belong together");
  }
  Rows(database_.statement("DELETE FROM mission WHERE mission_key = ?")).bind(m.key).run();
  static const std::string insert = "INSERT INTO mission (" + std::string(mission_identity_columns) + ", " +
                                    mission_content_columns() + ") VALUES (" +
                                    placeholders(mission_identity_columns) + ", " +
                                    placeholders(mission_content_columns()) + ")";
  const std::string faults = sample_faults_json(m);
  Rows rows(database_.statement(insert));
  bind_mission_identity(rows, m);
  bind_mission_content(rows, m, faults);
  rows.run();
  return m.key;
}

Outcome SqliteChanges::run(const CheckpointMission& c) {
  const Mission& m = c.mission;
  if (auto ok = check_trace(c.trace); !ok) return tl::unexpected(ok.error());
  static const std::string update = "UPDATE mission SET (" + mission_content_columns() + ") = (" +
                                    placeholders(mission_content_columns()) + ") WHERE mission_key = ?";
  {
    const std::string faults = sample_faults_json(m);
    Rows rows(database_.statement(update));
    bind_mission_content(rows, m, faults);
    if (rows.bind(m.key).run() == 0) return no_mission(m.key);
  }
  static const std::string replace = "INSERT OR REPLACE INTO trace (mission_key, " +
                                     std::string(trace_columns) + ") VALUES (?, " +
                                     placeholders(trace_columns) + ")";
  for (const TraceBucket& bucket : c.trace) {
    Rows rows(database_.statement(replace));
    rows.bind(m.key);
    bind_bucket(rows, bucket);
    rows.run();
  }
  append_samples(m.key, c.samples, m.state != MissionState::open);
  if (c.energy_state) put(*c.energy_state);
  return m.key;
}

void SqliteChanges::append_samples(MissionKey key, std::span<const Sample> samples, bool ended) {
  if (samples.empty() && !ended) return;
  std::int64_t next_ordinal = 0;
  {
    Rows rows(database_.statement("SELECT telemetry_samples FROM mission WHERE mission_key = ?"));
    if (rows.bind(key).next()) next_ordinal = rows.integer();
  }
  std::int64_t tail_samples = 0;
  {
    Rows rows(database_.statement(
        "SELECT coalesce(sum(samples), 0) FROM telemetry_chunk WHERE mission_key = ? AND sealed = 0"));
    if (rows.bind(key).next()) tail_samples = rows.integer();
  }
  if (samples.empty() && tail_samples == 0) return;
  const std::size_t unsealed = static_cast<std::size_t>(tail_samples) + samples.size();
  if (!ended && unsealed < sealed_chunk_samples) {
    insert_chunk(key, next_ordinal, samples, false);
  } else {
    std::vector<Sample> all = take_tail(key);
    std::int64_t ordinal = next_ordinal - static_cast<std::int64_t>(all.size());
    all.insert(all.end(), samples.begin(), samples.end());
    for (std::span<const Sample> rest = all; !rest.empty();) {
      const auto piece = rest.first(std::min(rest.size(), sealed_chunk_samples));
      insert_chunk(key, ordinal, piece, ended || piece.size() == sealed_chunk_samples);
      ordinal += static_cast<std::int64_t>(piece.size());
      rest = rest.subspan(piece.size());
    }
  }
  Rows(database_.statement("UPDATE mission SET telemetry_samples = ? WHERE mission_key = ?"))
      .bind(next_ordinal + static_cast<std::int64_t>(samples.size()))
      .bind(key)
      .run();
}

std::vector<Sample> SqliteChanges::take_tail(MissionKey key) {
  std::vector<Sample> all;
  bool readable = true;
  {
    Rows rows(
        database_.statement("SELECT body FROM telemetry_chunk WHERE mission_key = ? AND sealed = 0 "
                            "ORDER BY first_ordinal"));
    rows.bind(key);
    while (readable && rows.next()) {
      const auto samples = decode_chunk(rows.blob());
      readable = samples.has_value();
      if (readable) all.insert(all.end(), samples->begin(), samples->end());
    }
  }
  if (!readable) {
    // Damaged on disk: left as it is for the reader to report, and out of the way of what still comes.
    Rows(database_.statement("UPDATE telemetry_chunk SET sealed = 1 WHERE mission_key = ? AND sealed = 0"))
        .bind(key)
        .run();
    return {};
  }
  Rows(database_.statement("DELETE FROM telemetry_chunk WHERE mission_key = ? AND sealed = 0"))
      .bind(key)
      .run();
  return all;
}

void SqliteChanges::insert_chunk(MissionKey key, std::int64_t first_ordinal, std::span<const Sample> samples,
                                 bool sealed) {
  const auto [first, last] =
      std::minmax_element(samples.begin(), samples.end(),
                          [](const Sample& a, const Sample& b) { return a.utime_us < b.utime_us; });
  const std::vector<std::byte> body = encode_chunk(samples, sealed ? sealed_level : tail_level);
  Rows(database_.statement(
           "INSERT INTO telemetry_chunk (mission_key, first_ordinal, samples, start_utime_us, "
           "end_utime_us, stored_utime_us, sealed, bytes, body) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)"))
      .bind(key)
      .bind(first_ordinal)
      .bind(static_cast<std::int64_t>(samples.size()))
      .bind(first->utime_us)
      .bind(last->utime_us)
      .bind(now_utime_us_())
      .bind(sealed)
      .bind(static_cast<std::int64_t>(body.size()))
      .bind(std::span<const std::byte>(body))
      .run();
}

void SqliteChanges::put(const EnergyState& state) {
  make_robot(state.robot_id);
  static const std::string replace = "INSERT OR REPLACE INTO energy_state (" +
                                     std::string(energy_state_columns) + ") VALUES (" +
                                     placeholders(energy_state_columns) + ")";
  Rows rows(database_.statement(replace));
  bind_energy_state(rows, state);
  rows.run();
}

Outcome SqliteChanges::run(const PutEnergyState& c) {
  if (auto ok = check_robot_id(c.state.robot_id); !ok) return tl::unexpected(ok.error());
  put(c.state);
  return 0;
}

Outcome SqliteChanges::run(const PutLearned& c) {
  if (auto ok = check_robot_id(c.learned.robot_id); !ok) return tl::unexpected(ok.error());
  make_robot(c.learned.robot_id);
  Rows rows(
      database_.statement("INSERT OR REPLACE INTO learned (robot_id, topic, utime_us, body_json) "
                          "VALUES (?, ?, ?, ?)"));
  rows.bind(c.learned.robot_id).bind(c.learned.topic).bind(c.learned.utime_us).bind(c.learned.body_json);
  rows.run();
  return 0;
}

Outcome SqliteChanges::run(const AppendEvent& c) {
  Rows rows(
      database_.statement("INSERT INTO event (utime_us, robot_id, kind, detail_json) VALUES (?, nullif(?, "
                          "''), ?, ?) RETURNING event_id"));
  rows.bind(c.event.utime_us).bind(c.event.robot_id).bind(c.event.kind).bind(c.event.detail_json);
  rows.next();
  const std::int64_t id = rows.integer();
  rows.run();
  return id;
}

Outcome SqliteChanges::run(const Prune& c) {
  const Retention& keep = c.retention;
  if (c.max_chunks < 1) return invalid("max_chunks", "must be at least 1");
  std::int64_t total_bytes = 0;
  {
    Rows rows(database_.statement("SELECT coalesce(sum(bytes), 0) FROM telemetry_chunk"));
    if (rows.next()) total_bytes = rows.integer();
  }
  std::vector<std::int64_t> dropped;
  {
    // Only sealed chunks: a tail stays whole until it is merged.
    Rows rows(
        database_.statement("SELECT chunk_key, stored_utime_us, bytes FROM telemetry_chunk WHERE sealed = 1 "
                            "ORDER BY stored_utime_us, chunk_key LIMIT ?"));
    rows.bind(c.max_chunks);
    const std::int64_t now = now_utime_us_();
    while (rows.next()) {
      const std::int64_t key = rows.integer();
      const std::int64_t stored = rows.integer();
      const bool too_old = keep.telemetry_max_age_us && now - stored > *keep.telemetry_max_age_us;
      const bool too_much = keep.telemetry_max_bytes && total_bytes > *keep.telemetry_max_bytes;
      if (!too_old && !too_much) break;
      total_bytes -= rows.integer();
      dropped.push_back(key);
    }
  }
  for (const std::int64_t key : dropped)
    Rows(database_.statement("DELETE FROM telemetry_chunk WHERE chunk_key = ?")).bind(key).run();
  return static_cast<std::int64_t>(dropped.size());
}

}  // namespace joulecast::history
