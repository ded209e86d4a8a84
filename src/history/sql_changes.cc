#include "history/sql_changes.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <ranges>
#include <string_view>
#include <utility>

#include "base/try.h"
#include "history/audit.h"
#include "history/schema.h"
#include "history/sql_chunks.h"
#include "history/sql_queries.h"

namespace joulecast::history {
namespace {

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

// Selects the stored sizes of the missions that satisfy `which`, from which they are continued.
std::string places_sql(bool is_postgres, const std::string& which) {
  return "SELECT mission_key, robot_id, start_utime_us, telemetry_samples, covariate_changes, state <> "
         "'open' FROM mission WHERE " +
         which +
         // A concurrent deletion of the mission waits, and then finds these rows.
         (is_postgres ? " FOR NO KEY UPDATE" : "");
}

std::string mission_content() {
  return columns_of<Mission>(mission_identity);
}

BulkRows bulk_checkpoints() {
  return {"mission", mission_content() + ", telemetry_samples, covariate_changes, mission_key",
          [](const std::string& from) {
            std::string values;
            const std::string all = mission_content();
            for (const std::string& column : column_names(all)) values += "new." + column + ", ";
            return "UPDATE mission SET (" + all + ", telemetry_samples, covariate_changes) = (" + values +
                   "mission.telemetry_samples + new.telemetry_samples, mission.covariate_changes + "
                   "new.covariate_changes) FROM " +
                   from + " WHERE mission.mission_key = new.mission_key";
          }};
}

Result<void> check_covariates(const std::vector<signals::CovariateChange>& changes) {
  for (std::size_t i = 0; i < changes.size(); ++i)
    if (!signals::is_valid_covariate_name(changes[i].name))
      return invalid("/covariates/" + std::to_string(i) + "/name", "is no name of a covariate");
  return {};
}

}  // namespace

struct SqlChanges::Bulk {
  BulkRows missions = bulk_checkpoints();
  BulkRows trace = bulk_replace("trace", "mission_key, start_utime_us", columns_of<TraceBucket>(1));
  BulkRows telemetry = bulk_insert("telemetry_chunk", chunks::telemetry_columns());
  BulkRows states = bulk_replace("energy_state", "robot_id", columns_of<ResumeState>(1));
  std::set<MissionKey> keys;        // of missions with rows here
  std::set<std::string> robot_ids;  // of states here
};

SqlChanges::SqlChanges(Database& database, std::function<std::int64_t()> now_utime_us, std::string writer)
    : database_(database), now_utime_us_(std::move(now_utime_us)), writer_(std::move(writer)) {
  if (database.is_postgres()) bulk_ = std::make_unique<Bulk>();
}

SqlChanges::~SqlChanges() = default;

void SqlChanges::forget_collected() {
  places_.clear();
  tails_.clear();
  known_robots_.clear();
  if (!bulk_) return;
  for (BulkRows* rows : {&bulk_->missions, &bulk_->trace, &bulk_->telemetry, &bulk_->states}) rows->clear();
  bulk_->keys.clear();
  bulk_->robot_ids.clear();
}

void SqlChanges::begin(std::span<const Command> commands) {
  days_.clear();
  // After a transaction that was not committed nothing that was found out in it holds.
  constexpr std::size_t most_tails = 100'000;
  if (!committed_ || tails_.size() > most_tails) tails_.clear();
  auto tails = std::move(tails_);
  forget_collected();
  tails_ = std::move(tails);
  committed_ = false;
  stored_already_ = 0;
  in_spool_ = false;
  lock_leases(commands);
}

void SqlChanges::flush() {
  if (!bulk_) return;
  for (BulkRows* rows : {&bulk_->missions, &bulk_->trace, &bulk_->telemetry, &bulk_->states})
    rows->flush(database_);
  bulk_->keys.clear();
  bulk_->robot_ids.clear();
}

// For all missions in one query, instead of one query each.
void SqlChanges::look_up_places(std::span<const Command> commands) {
  if (!bulk_) return;
  std::string keys;
  for (const Command& command : commands)
    if (const auto* checkpoint = std::get_if<CheckpointMission>(&command))
      keys += (keys.empty() ? "{" : ",") + std::to_string(checkpoint->mission.key);
  if (keys.empty()) return;
  keys += '}';
  static const std::string sql = places_sql(true, "mission_key = ANY (?::text::bigint[])");
  Rows rows(database_, sql, keys);
  read_places(rows);
}

void SqlChanges::read_places(Rows& rows) {
  while (rows.next()) {
    Place& place = places_[rows.integer()];
    read_values(rows, place.robot_id, place.start_utime_us, place.samples, place.changes, place.was_ended);
  }
}

std::optional<SqlChanges::Place> SqlChanges::take_place(MissionKey key) {
  if (places_.find(key) == places_.end()) {
    static const std::array sql = {places_sql(false, "mission_key = ?"), places_sql(true, "mission_key = ?")};
    Rows rows(database_, sql[database_.is_postgres()], key);
    read_places(rows);
  }
  auto found = places_.extract(key);
  if (!found) return std::nullopt;
  find_tails(key, found.mapped());
  return std::move(found.mapped());
}

// Another writer that changed the tails has also changed the mission's counts, or ended it.
void SqlChanges::find_tails(MissionKey key, Place& place) {
  const auto left = tails_.find(key);
  if (left != tails_.end() && !place.was_ended && left->second.samples == place.samples &&
      left->second.changes == place.changes) {
    static_cast<Tails&>(place) = left->second;
    return;
  }
  static const std::string sql = "SELECT " + chunks::in_tails_sql() + " FROM mission WHERE mission_key = ?";
  Rows rows(database_, sql, key);
  if (!rows.next()) return;
  read_values(rows, place.samples_in_tail, place.changes_in_tail);
}

// In one statement for all robots, in the order of their names, so that no two programs wait for each other.
void SqlChanges::lock_leases(std::span<const Command> commands) {
  epochs_.clear();
  dropped_.clear();
  std::set<std::string_view> robots;
  for (const Command& command : commands)
    if (const auto fence = fence_of(command)) robots.insert(fence->robot_id);
  if (robots.empty()) return;
  const std::string names = nlohmann::json(robots).dump();
  Rows rows(database_,
            "SELECT robot_id, epoch FROM cluster_lease WHERE robot_id IN (SELECT "
            "json_array_elements_text(?::json)) ORDER BY robot_id FOR NO KEY UPDATE",
            names);
  epochs_ = read_by_name<decltype(epochs_)>(rows);
}

bool SqlChanges::stands(const Command& command) {
  const auto fence = fence_of(command);
  if (!fence) return true;
  const auto lease = epochs_.find(fence->robot_id);
  if (lease != epochs_.end() && lease->second == fence->epoch) return true;
  DroppedCommands& dropped = dropped_[std::string(fence->robot_id)];
  dropped.epoch = fence->epoch;
  ++dropped.count;
  return false;
}

// Raw samples are evidence, whoever keeps the robot by now. Those that its keeper has passed, and that none
// of the robot's missions has, are added to the recording of their mission; its accounts stay the keeper's.
Outcome SqlChanges::keep_samples(const Command& command) {
  const auto* c = std::get_if<CheckpointMission>(&command);
  if (c == nullptr || c->samples.empty()) return 0;
  flush();
  places_.clear();
  const Mission& m = c->mission;
  const auto [first, last] = std::ranges::minmax(c->samples, {}, &signals::Sample::utime_us);
  std::int64_t passed_utime_us = 0;
  MissionKey key = 0;
  std::vector<MissionKey> keys;
  {
    Rows rows(database_,
              "SELECT mission_key, mission_id = ? AND start_utime_us = ?, coalesce(utime_us, 0) FROM mission "
              "JOIN cluster_lease USING (robot_id) WHERE robot_id = ? AND (start_utime_us <= ? AND "
              "end_utime_us >= ? OR mission_id = ? AND start_utime_us = ?)",
              m.mission_id, m.start_utime_us, m.robot_id, last.utime_us, first.utime_us, m.mission_id,
              m.start_utime_us);
    while (rows.next()) {
      keys.push_back(rows.integer());
      if (rows.boolean()) key = keys.back();
      passed_utime_us = rows.integer();
    }
  }
  std::set<std::pair<std::int64_t, std::int64_t>> stored;
  for (const MissionKey each : keys) {
    PageRequest page{max_telemetry_samples, {}};
    do {
      TRY_ASSIGN(auto got, chunks::read_page<signals::Sample>(database_, each,
                                                              {first.utime_us, last.utime_us + 1}, page));
      for (const signals::Sample& sample : got.items) stored.emplace(sample.utime_us, sample.sequence);
      page.cursor = std::move(got.next_cursor);
    } while (!page.cursor.empty());
  }
  std::vector<signals::Sample> missing;
  for (const signals::Sample& sample : c->samples)
    if (sample.utime_us <= passed_utime_us && !stored.contains({sample.utime_us, sample.sequence}))
      missing.push_back(sample);
  const auto place = missing.empty() || key == 0 ? std::nullopt : take_place(key);
  if (!place) return 0;
  const auto count = static_cast<std::int64_t>(missing.size());
  Rows(database_, "UPDATE mission SET telemetry_samples = telemetry_samples + ? WHERE mission_key = ?", count,
       key)
      .run();
  chunks::append(database_, {key, place->samples, place->samples_in_tail}, missing, place->was_ended,
                 now_utime_us_());
  tails_.erase(key);
  dropped_[m.robot_id].samples += missing.size();
  return 0;
}

void SqlChanges::apply(std::span<const Command> commands, const std::function<void()>& before_commit,
                       std::vector<Outcome>& outcomes) {
  // Nearly always no command is refused, and then none needs a savepoint of its own.
  {
    Transaction transaction(database_, Database::Access::write);
    begin(commands);
    look_up_places(commands);
    if (apply_unguarded(commands, outcomes)) {
      days_.add_up(database_);
      if (before_commit) before_commit();
      transaction.commit();
      committed_ = true;
      return;
    }
  }
  outcomes.clear();
  Transaction transaction(database_, Database::Access::write);
  begin(commands);
  for (const Command& command : commands) {
    outcomes.push_back(apply_guarded(command));
    if (!outcomes.back() && std::holds_alternative<TakeSpool>(command))
      return outcomes.resize(commands.size(), outcomes.back());
  }
  days_.add_up(database_);
  if (before_commit) before_commit();
  transaction.commit();
  committed_ = true;
}

bool SqlChanges::apply_unguarded(std::span<const Command> commands, std::vector<Outcome>& outcomes) {
  try {
    for (const Command& command : commands) {
      outcomes.push_back(run_one(command));
      if (!outcomes.back()) return false;
    }
    flush();
    database_.finish_later();
  } catch (const SqlError& error) {
    if (!error.is_about_values()) throw;
    return false;
  }
  return true;
}

Outcome SqlChanges::run_one(const Command& command) {
  if (stored_already_ > 0) return --stored_already_, 0;
  if (!stands(command)) return in_spool_ ? keep_samples(command) : Outcome(0);
  // Collected rows may wait during these commands only.
  if (!std::holds_alternative<CheckpointMission>(command) && !std::holds_alternative<StartMission>(command) &&
      !std::holds_alternative<PutResumeState>(command) && !std::holds_alternative<AppendEvent>(command) &&
      !std::holds_alternative<PutLearned>(command)) {
    flush();
    places_.clear();
  }
  return std::visit([this](const auto& c) { return run(c); }, command);
}

Outcome SqlChanges::apply_guarded(const Command& command) {
  Rows(database_, "SAVEPOINT command").run();
  Outcome outcome = [&]() -> Outcome {
    try {
      Outcome done = run_one(command);
      if (done) flush();
      database_.finish_later();
      return done;
    } catch (const SqlError& error) {
      if (!error.is_about_values()) throw;
      return invalid("", error.what());
    }
  }();
  if (!outcome) {
    Rows(database_, "ROLLBACK TO command").run();
    forget_collected();
  }
  Rows(database_, "RELEASE command").run();
  return outcome;
}

void SqlChanges::make_robot(const std::string& robot_id) {
  if (bulk_ && !known_robots_.insert(robot_id).second) return;
  Rows(database_, "INSERT INTO robot (robot_id, created_utime_us) VALUES (?, ?) ON CONFLICT DO NOTHING",
       robot_id, now_utime_us_())
      .run_later();
}

void SqlChanges::lock_robot(const std::string& robot_id) {
  if (writer_.empty()) return;
  Rows(database_, "SELECT 1 FROM robot WHERE robot_id = ? FOR NO KEY UPDATE", robot_id).run();
}

Outcome SqlChanges::run(const AddModel& c) {
  TRY(check_robot_id(c.robot_id));
  make_robot(c.robot_id);
  lock_robot(c.robot_id);  // versions are numbered in turn
  std::optional<std::int64_t> active;
  {
    Rows rows(database_, "SELECT active_version FROM robot WHERE robot_id = ?", c.robot_id);
    if (rows.next()) active = rows.optional_integer();
  }
  if (c.expected_active && *c.expected_active != active.value_or(0))
    return fail(Fault::conflict, "model_version",
                "version " + std::to_string(active.value_or(0)) + " is active, not " +
                    std::to_string(*c.expected_active));
  if (active) {
    Rows same(database_, "SELECT model_json = ? FROM model WHERE robot_id = ? AND version = ?", c.model_json,
              c.robot_id, *active);
    if (same.next() && same.boolean()) return *active;
  }
  ModelVersion next{c.robot_id, 1,     c.utime_us,   c.origin,       c.note,
                    active,     false, c.model_json, c.evidence_json};
  {
    Rows rows(database_, "SELECT coalesce(max(version), 0) + 1 FROM model WHERE robot_id = ?", c.robot_id);
    if (rows.next()) next.version = rows.integer();
  }
  insert_record(database_, "model", next);
  return run(ActivateModel{c.robot_id, next.version});
}

Outcome SqlChanges::run(const ActivateModel& c) {
  const std::int64_t changed = Rows(database_,
                                    "UPDATE robot SET active_version = ?1 WHERE robot_id = ?2 AND EXISTS "
                                    "(SELECT 1 FROM model WHERE robot_id = ?2 AND version = ?1)",
                                    c.version, c.robot_id)
                                   .run();
  if (changed == 0)
    return fail(Fault::not_found, "model_version",
                "robot '" + c.robot_id + "' has no model version " + std::to_string(c.version));
  return c.version;
}

BatchMark SqlChanges::mark_of(Database& database) {
  Rows rows(database, "SELECT identity, writer, batch FROM joulecast_store");
  BatchMark mark;
  if (rows.next()) read_values(rows, mark.store, mark.writer, mark.batch);
  return mark;
}

Outcome SqlChanges::run(const TakeSpool& c) {
  Rows taken(database_, "SELECT 1 FROM taken_spool WHERE hash = ?", c.hash);
  if (taken.next()) return invalid("spool", "was taken in before");
  BatchMark now = mark_of(database_);
  if (now.store != c.after.store) return fail(Fault::conflict, "spool", "is of another store");
  if (database_.is_postgres()) {  // of daemons that share a store each has its own mark
    Rows own(database_, "SELECT batch FROM cluster_writer WHERE writer = ?", c.after.writer);
    if (own.next()) now = {c.after.store, c.after.writer, own.integer()};
  }
  // A store that was put back to a copy made since is behind the spool, which goes on from there.
  if (now.writer != c.after.writer)
    return fail(
        Fault::conflict, "spool",
        "was written by " + c.after.writer + ", and " + now.writer + " has written to the store since");
  Rows(database_, "INSERT INTO taken_spool (hash, utime_us) VALUES (?, ?)", c.hash, now_utime_us_()).run();
  in_spool_ = true;
  return stored_already_ = now.batch > c.after.batch ? c.attempted : 0;
}

Result<void> SqlChanges::claim(const RequestAnswer& key) {
  // Waiting for another daemon's transaction would delay this one's accounts.
  if (!writer_.empty()) {
    Rows held(database_,
              "SELECT pg_try_advisory_xact_lock(1246512982, hashtext(concat_ws(' ', current_schema(), "
              "?::text, ?::text)))::int",
              key.actor, key.key);
    if (!held.next() || !held.boolean())
      return fail(Fault::conflict, std::string(Change::key_field),
                  "a request under this key is being handled");
  }
  const std::int64_t made =
      Rows(database_,
           "INSERT INTO request_answer (actor, idempotency_key, fingerprint, utime_us, status, location, "
           "body) VALUES (?, ?, ?, ?, 0, '', '') ON CONFLICT DO NOTHING",
           key.actor, key.key, key.fingerprint, key.utime_us)
          .run();
  if (made == 1) return {};
  return fail(Fault::conflict, std::string(Change::key_field), "a request was answered under this key");
}

Outcome SqlChanges::run(const CommitChange& c) {
  Change& change = *c.change;
  if (change.key) TRY(claim(*change.key));
  const Outcome outcome = change.command ? run_one(*change.command) : Outcome(0);
  if (!outcome || !change.follow) return outcome;
  change.followed = change.follow(*outcome);
  for (const Command& followed : change.followed)
    if (Outcome done = run_one(followed); !done) return done;
  return outcome;
}

Outcome SqlChanges::run(const StartMission& c) {
  const Mission& m = c.mission;
  TRY(check_robot_id(m.robot_id));
  if (m.key <= 0) return invalid("key", "must be one that new_mission_key() gave");
  make_robot(m.robot_id);
  std::vector<MissionKey> replaced;
  {
    Rows rows(
        database_,
        "SELECT mission_key, robot_id = ?2 AND mission_id = ?3 AND start_utime_us = ?4 FROM mission WHERE "
        "mission_key = ?1 OR robot_id = ?2 AND mission_id = ?3 AND start_utime_us = ?4",
        m.key, m.robot_id, m.mission_id, m.start_utime_us);
    while (rows.next()) {
      replaced.push_back(rows.integer());
      if (!rows.boolean())
        return fail(Fault::conflict, "key", "key " + std::to_string(m.key) + " is another mission's");
    }
  }
  if (bulk_ && !replaced.empty()) flush();
  for (const MissionKey key : replaced) {
    Rows(database_, "DELETE FROM mission WHERE mission_key = ?", key).run_later();
    chunks::drop_recordings(database_, key);
    places_.erase(key);
    tails_.erase(key);
  }
  days_.changed(m.robot_id, m.start_utime_us);
  insert_record(database_, "mission", m);
  Place& place = places_[m.key] = {};
  place.robot_id = m.robot_id;
  place.start_utime_us = m.start_utime_us;
  tails_[m.key] = {};
  return m.implicit ? 0 : last_called(database_, m.robot_id, m.mission_id, m.start_utime_us);
}

Outcome SqlChanges::run(const CheckpointMission& c) {
  const Mission& m = c.mission;
  TRY(check_trace(c.trace));
  TRY(check_covariates(c.covariates));
  if (bulk_ && bulk_->keys.contains(m.key)) flush();
  const std::optional<Place> place = take_place(m.key);
  if (!place) return no_mission(m.key);
  const bool ended = m.state != MissionState::open;
  if (place->was_ended || ended) days_.changed(place->robot_id, place->start_utime_us);
  update(c);
  put(m.key, c.trace);
  chunks::End telemetry{m.key, place->samples, place->samples_in_tail};
  if (bulk_) telemetry.collected = &bulk_->telemetry;
  Tails left{place->samples + static_cast<std::int64_t>(c.samples.size()),
             place->changes + static_cast<std::int64_t>(c.covariates.size())};
  left.samples_in_tail = chunks::append(database_, telemetry, c.samples, ended, now_utime_us_());
  left.changes_in_tail = chunks::append(database_, {m.key, place->changes, place->changes_in_tail},
                                        c.covariates, ended, now_utime_us_());
  ended ? void(tails_.erase(m.key)) : void(tails_[m.key] = left);
  if (bulk_) bulk_->keys.insert(m.key);
  if (c.resume_state) put(*c.resume_state);
  if (c.epoch != 0 && c.position) put_position(m.robot_id, *c.position);
  return m.key;
}

void SqlChanges::update(const CheckpointMission& c) {
  static const std::string one = "UPDATE mission SET (" + mission_content() + ") = (" +
                                 placeholders(mission_content()) +
                                 "), telemetry_samples = telemetry_samples + ?, covariate_changes = "
                                 "covariate_changes + ? WHERE mission_key = ?";
  Rows rows(bulk_ ? bulk_->missions : database_.statement(one));
  bind_record(rows, c.mission, mission_identity);
  rows.bind(static_cast<std::int64_t>(c.samples.size())).bind(static_cast<std::int64_t>(c.covariates.size()));
  rows.bind(c.mission.key).run_later();
}

void SqlChanges::put(MissionKey key, const std::vector<TraceBucket>& trace) {
  static const std::string one =
      insert_or_replace("trace", "mission_key, start_utime_us", columns_of<TraceBucket>(1));
  std::set<std::int64_t> starts;
  for (const TraceBucket& bucket : trace) {
    if (bulk_ && !starts.insert(bucket.start_utime_us).second) {
      flush();
      starts = {bucket.start_utime_us};
    }
    Rows rows(bulk_ ? bulk_->trace : database_.statement(one));
    rows.bind(key);
    bind_record(rows, bucket);
    rows.run_later();
  }
}

void SqlChanges::put(const ResumeState& state) {
  make_robot(state.robot_id);
  static const std::string replace = replace_sql<ResumeState>("energy_state", 1);
  if (bulk_ && !bulk_->robot_ids.insert(state.robot_id).second) {
    flush();
    bulk_->robot_ids.insert(state.robot_id);
  }
  Rows rows(bulk_ ? bulk_->states : database_.statement(replace));
  bind_record(rows, state);
  rows.run_later();
}

Outcome SqlChanges::run(const PutResumeState& c) {
  TRY(check_robot_id(c.state.robot_id));
  put(c.state);
  if (c.epoch != 0) put_position(c.state.robot_id, {c.state.utime_us, c.state.sequence});
  return 0;
}

void SqlChanges::put_position(const std::string& robot_id, const StreamPosition& position) {
  Rows(database_, "UPDATE cluster_lease SET utime_us = ?, sequence = ? WHERE robot_id = ?", position.utime_us,
       position.sequence, robot_id)
      .run_later();
}

Outcome SqlChanges::run(const PutLearned& c) {
  TRY(check_robot_id(c.learned.robot_id));
  make_robot(c.learned.robot_id);
  if (c.expected_utime_us) {
    lock_robot(c.learned.robot_id);
    TRY_ASSIGN(const auto stored, learned(database_, c.learned.robot_id, c.learned.topic));
    if ((stored ? stored->utime_us : 0) != *c.expected_utime_us)
      return fail(Fault::conflict, c.learned.topic, "another one was stored at the same time; try again");
  }
  replace_record(database_, "learned", 2, c.learned);
  return 0;
}

Outcome SqlChanges::run(const AppendEvent& c) {
  return insert_numbered(database_, "event", c.event);
}

Outcome SqlChanges::run(const AppendAudit& c) {
  lock_audit();
  return append_audit(database_, c.entry);
}

void SqlChanges::lock_audit() {
  if (!writer_.empty())
    Rows(database_, "SELECT pg_advisory_xact_lock(1246512981, hashtext(current_schema()))").run();
}

Outcome SqlChanges::run(const Prune& c) {
  const Retention& keep = c.retention;
  if (c.max_chunks < 1) return invalid("max_chunks", "must be at least 1");
  return chunks::prune(database_, keep, c.max_chunks, now_utime_us_());
}

Outcome SqlChanges::run(const PruneMissions& c) {
  if (c.max_missions < 1) return invalid("max_missions", "must be at least 1");
  Rows rows(database_,
            "DELETE FROM mission WHERE mission_key IN (SELECT mission_key FROM mission WHERE state <> 'open' "
            "AND end_utime_us < ? ORDER BY start_utime_us, mission_key LIMIT ?) RETURNING robot_id, "
            "start_utime_us, mission_key",
            now_utime_us_() - c.max_age_us, c.max_missions);
  return drop_missions(rows);
}

std::int64_t SqlChanges::drop_missions(Rows& deleted) {
  std::vector<MissionKey> keys;
  while (deleted.next()) {
    const std::string robot_id = deleted.text();
    days_.changed(robot_id, deleted.integer());
    keys.push_back(deleted.integer());
  }
  for (const MissionKey key : keys) chunks::drop_recordings(database_, key);
  return static_cast<std::int64_t>(keys.size());
}

Outcome SqlChanges::run(const PruneEvents& c) {
  if (c.keep < 1) return invalid("keep", "must be at least 1: the last event's number must not come again");
  if (c.max_events < 1) return invalid("max_events", "must be at least 1");
  return Rows(database_,
              "DELETE FROM event WHERE event_id IN (SELECT event_id FROM event WHERE event_id <= (SELECT "
              "event_id FROM event ORDER BY event_id DESC LIMIT 1 OFFSET ?) ORDER BY event_id LIMIT ?)",
              c.keep, c.max_events)
      .run();
}

Outcome SqlChanges::run(const PruneAudit& c) {
  if (c.max_entries < 1) return invalid("max_entries", "must be at least 1");
  lock_audit();
  const std::int64_t now_utime_us = now_utime_us_(), before_utime_us = now_utime_us - c.max_age_us;
  return shorten_audit(database_, before_utime_us - before_utime_us % day_us, c.max_entries, now_utime_us);
}

Outcome SqlChanges::run(const KeepAnswer& c) {
  const RequestAnswer& answer = c.answer;
  if (answer.key.empty()) return invalid("key", "must not be empty");
  replace_record(database_, "request_answer", 2, answer);
  Rows(database_, "DELETE FROM request_answer WHERE utime_us < ?", answer.utime_us - kept_answer_us).run();
  return 0;
}

Outcome SqlChanges::run(const PutFloorPlan& c) {
  const FloorPlan& plan = c.plan;
  if (plan.image.empty()) {
    Rows rows(database_, "DELETE FROM floor_plan WHERE map = ? AND level = ?", plan.map, plan.level);
    if (rows.run() == 0) return no_floor_plan(plan.map, plan.level);
    return 0;
  }
  replace_record(database_, "floor_plan", 2, plan);
  return 0;
}

Outcome SqlChanges::run(const RemoveRobot& c) {
  const auto change = [&](std::string_view sql) { return Rows(database_, sql, c.robot_id).run(); };
  if (change("UPDATE robot SET active_version = NULL WHERE robot_id = ?") == 0)
    return fail(Fault::not_found, "robot_id", "no robot is called '" + c.robot_id + "'");
  if (!c.purge) {
    Rows rows(database_,
              "UPDATE mission SET state = 'interrupted' WHERE robot_id = ? AND state = 'open' RETURNING "
              "start_utime_us",
              c.robot_id);
    while (rows.next()) days_.changed(c.robot_id, rows.integer());
    return 0;
  }
  if (database_.is_postgres()) {
    change(
        "DELETE FROM cluster_job WHERE diagnosis_id IN (SELECT diagnosis_id FROM diagnosis WHERE robot_id = "
        "?)");
    change("DELETE FROM mission_day WHERE robot_id = ?");
  }
  std::int64_t missions = 0;
  for (const Table& table : store_tables() | std::views::reverse) {
    const bool has_robot =
        std::ranges::any_of(table.columns, [](const auto& column) { return column.first == "robot_id"; });
    if (table.name == "event" || !has_robot) continue;
    const std::string sql = "DELETE FROM " + table.name + " WHERE robot_id = ?";
    if (table.name == "mission") {
      Rows deleted(database_, sql + " RETURNING robot_id, start_utime_us, mission_key");
      missions = drop_missions(deleted.bind(c.robot_id));
    } else {
      change(sql);
    }
  }
  days_.forget(c.robot_id);
  known_robots_.erase(c.robot_id);
  return missions;
}

Outcome SqlChanges::run(const ReleaseLease& c) {
  Rows(database_, "UPDATE cluster_lease SET node = NULL WHERE robot_id = ?", c.robot_id).run_later();
  return 0;
}

}  // namespace joulecast::history
