#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "base/try.h"
#include "history/sql_changes.h"
#include "history/sql_queries.h"

// Diagnoses and proposals as rows: the commands that change them and the queries that read them.
namespace joulecast::history {
namespace {

std::string keys_json(const std::vector<MissionKey>& keys) {
  return nlohmann::json(keys).dump();
}

Result<std::vector<MissionKey>> parse_keys(const std::string& text) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  std::vector<MissionKey> keys;
  if (!json.is_array()) return fail(Fault::corrupt, "mission keys", "'" + text + "' is no array");
  for (const auto& key : json) {
    if (!key.is_number_integer()) return fail(Fault::corrupt, "mission keys", "'" + text + "' holds no keys");
    keys.push_back(key.get<MissionKey>());
  }
  return keys;
}

tl::unexpected<Error> no_diagnosis(std::int64_t id) {
  return fail(Fault::not_found, "diagnosis", "no diagnosis has id " + std::to_string(id));
}

tl::unexpected<Error> no_proposal(std::int64_t id) {
  return fail(Fault::not_found, "proposal", "no proposal has id " + std::to_string(id));
}

std::string select_diagnoses(bool whole) {
  return std::string(
             "SELECT diagnosis_id, robot_id, created_utime_us, started_utime_us, finished_utime_us, state, "
             "cause, "
             "request_json, model_version, fitted_on, held_back, coalesce(summary_json, ''), ") +
         (whole ? "coalesce(result_json, ''), coalesce(model_json, '')" : "'', ''") +
         ", error FROM diagnosis";
}

Result<DiagnosisRecord> read_diagnosis(Rows& rows) {
  DiagnosisRecord d;
  d.id = rows.integer();
  d.robot_id = rows.text();
  d.created_utime_us = rows.integer();
  d.started_utime_us = rows.optional_integer();
  d.finished_utime_us = rows.optional_integer();
  const auto state = diagnosis_state_from(rows.text());
  const auto cause = diagnosis_cause_from(rows.text());
  if (!state || !cause) return fail(Fault::corrupt, "diagnosis", "unknown state or cause");
  d.state = *state;
  d.cause = *cause;
  d.request_json = rows.text();
  d.model_version = rows.optional_integer();
  for (auto* keys : {&d.fitted_on, &d.held_back}) {
    TRY_ASSIGN(auto read, parse_keys(rows.text()));
    *keys = std::move(read);
  }
  d.summary_json = rows.text();
  d.result_json = rows.text();
  d.model_json = rows.text();
  d.error = rows.text();
  return d;
}

constexpr std::string_view select_proposals =
    "SELECT proposal_id, robot_id, created_utime_us, kind, state, note, base_version, adopted_version, "
    "fitted_on, "
    "model_json, detail_json FROM proposal";

Result<Proposal> read_proposal(Rows& rows) {
  Proposal p;
  p.id = rows.integer();
  p.robot_id = rows.text();
  p.created_utime_us = rows.integer();
  p.kind = rows.text();
  const auto state = proposal_state_from(rows.text());
  if (!state) return fail(Fault::corrupt, "proposal", "unknown state");
  p.state = *state;
  p.note = rows.text();
  p.base_version = rows.optional_integer();
  p.adopted_version = rows.optional_integer();
  TRY_ASSIGN(auto keys, parse_keys(rows.text()));
  p.fitted_on = std::move(keys);
  p.model_json = rows.text();
  p.detail_json = rows.text();
  return p;
}

template <class T, class Read, class None>
Result<T> by_id(Database& database, const std::string& sql, std::int64_t id, Read read, None none) {
  Rows rows(database.statement(sql));
  if (!rows.bind(id).next()) return none(id);
  return read(rows);
}

template <class T, class Read>
Result<std::vector<T>> page(Database& database, const std::string& select, std::string_view id,
                            const std::optional<std::string>& robot_id, std::int64_t before_id,
                            std::int64_t limit, Read read) {
  TRY(queries::check_limit("limit", limit, max_page_size));
  Rows rows(database.statement(select + " WHERE " + std::string(id) + " < ?" +
                               (robot_id ? " AND robot_id = ?" : "") + " ORDER BY " + std::string(id) +
                               " DESC LIMIT ?"));
  rows.bind(before_id);
  if (robot_id) rows.bind(*robot_id);
  rows.bind(limit);
  return queries::read_all<T>(rows, read);
}

}  // namespace

Outcome SqlChanges::run(const AddDiagnosis& c) {
  const DiagnosisRecord& d = c.diagnosis;
  Rows(database_.statement(
           "DELETE FROM diagnosis WHERE robot_id = ?1 AND state NOT IN ('queued', 'running') AND "
           "diagnosis_id <= (SELECT diagnosis_id FROM diagnosis WHERE robot_id = ?1 ORDER BY "
           "diagnosis_id DESC LIMIT 1 OFFSET ?2)"))
      .bind(d.robot_id)
      .bind(kept_diagnoses - 1)
      .run();
  const std::string fitted_on = keys_json(d.fitted_on), held_back = keys_json(d.held_back);
  Rows rows(database_.statement(
      "INSERT INTO diagnosis (robot_id, created_utime_us, state, cause, request_json, "
      "model_version, fitted_on, held_back, error) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?) RETURNING "
      "diagnosis_id"));
  rows.bind(d.robot_id).bind(d.created_utime_us).bind(name(d.state)).bind(name(d.cause)).bind(d.request_json);
  rows.bind(d.model_version).bind(fitted_on).bind(held_back).bind(d.error);
  rows.next();
  const std::int64_t id = rows.integer();
  rows.run();
  if (!writer_.empty())
    Rows(database_.statement("INSERT INTO cluster_job VALUES (?, ?)")).bind(id).bind(writer_).run();
  return id;
}

bool SqlChanges::has_job(std::int64_t diagnosis_id) {
  if (writer_.empty()) return true;
  Rows rows(
      database_.statement("SELECT 1 FROM cluster_job WHERE diagnosis_id = ? AND writer = ? FOR UPDATE"));
  rows.bind(diagnosis_id).bind(writer_);
  return rows.next();
}

Outcome SqlChanges::run(const UpdateDiagnosis& c) {
  const DiagnosisRecord& d = c.diagnosis;
  if (!has_job(d.id))
    return fail(Fault::conflict, "id", "another daemon has taken diagnosis " + std::to_string(d.id));
  const std::string fitted_on = keys_json(d.fitted_on), held_back = keys_json(d.held_back);
  const auto changed =
      Rows(database_.statement(
               "UPDATE diagnosis SET (started_utime_us, finished_utime_us, state, model_version, fitted_on, "
               "held_back, summary_json, result_json, model_json, error) = (?, ?, ?, ?, ?, ?, nullif(?, ''), "
               "nullif(?, ''), nullif(?, ''), ?) "
               "WHERE diagnosis_id = ?"))
          .bind(d.started_utime_us)
          .bind(d.finished_utime_us)
          .bind(name(d.state))
          .bind(d.model_version)
          .bind(fitted_on)
          .bind(held_back)
          .bind(d.summary_json)
          .bind(d.result_json)
          .bind(d.model_json)
          .bind(d.error)
          .bind(d.id)
          .run();
  if (changed == 0) return no_diagnosis(d.id);
  if (!writer_.empty() && d.state != DiagnosisState::queued && d.state != DiagnosisState::running)
    Rows(database_.statement("DELETE FROM cluster_job WHERE diagnosis_id = ?")).bind(d.id).run();
  if (!c.report_html.empty()) {
    static const std::string replace = insert_or_replace("diagnosis_report", "diagnosis_id", "html");
    Rows(database_.statement(replace)).bind(d.id).bind(c.report_html).run();
  }
  return d.id;
}

Outcome SqlChanges::run(const InterruptDiagnoses& c) {
  if (!writer_.empty()) return 0;  // another daemon takes over the abandoned diagnoses
  return Rows(database_.statement(
                  "UPDATE diagnosis SET state = 'interrupted', finished_utime_us = ?, error = 'the "
                  "service stopped before it was done' WHERE state IN ('queued', 'running')"))
      .bind(c.utime_us)
      .run();
}

Outcome SqlChanges::run(const AddProposal& c) {
  const Proposal& p = c.proposal;
  Rows(database_.statement(
           "UPDATE proposal SET state = 'superseded' WHERE robot_id = ? AND kind = ? AND state = 'open'"))
      .bind(p.robot_id)
      .bind(p.kind)
      .run();
  const std::string fitted_on = keys_json(p.fitted_on);
  Rows rows(database_.statement(
      "INSERT INTO proposal (robot_id, created_utime_us, kind, state, note, base_version, "
      "adopted_version, fitted_on, model_json, detail_json) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?) "
      "RETURNING proposal_id"));
  rows.bind(p.robot_id).bind(p.created_utime_us).bind(p.kind).bind(name(p.state)).bind(p.note);
  rows.bind(p.base_version).bind(p.adopted_version).bind(fitted_on).bind(p.model_json).bind(p.detail_json);
  rows.next();
  const std::int64_t id = rows.integer();
  rows.run();
  return id;
}

Outcome SqlChanges::run(const CloseProposal& c) {
  const auto changed = Rows(database_.statement("UPDATE proposal SET state = ?, adopted_version = ? WHERE "
                                                "proposal_id = ? AND state = 'open'"))
                           .bind(name(c.state))
                           .bind(c.adopted_version)
                           .bind(c.id)
                           .run();
  if (changed > 0) return c.id;
  TRY_ASSIGN(const auto stored, queries::proposal(database_, c.id));
  return fail(Fault::conflict, "proposal",
              "proposal " + std::to_string(c.id) + " is " + std::string(name(stored.state)) + " already");
}

namespace queries {

Result<DiagnosisRecord> diagnosis(Database& database, std::int64_t id) {
  static const std::string sql = select_diagnoses(true) + " WHERE diagnosis_id = ?";
  return by_id<DiagnosisRecord>(database, sql, id, read_diagnosis, no_diagnosis);
}

Result<std::vector<DiagnosisRecord>> diagnoses(Database& database, const std::optional<std::string>& robot_id,
                                               std::int64_t before_id, std::int64_t limit) {
  static const std::string select = select_diagnoses(false);
  return page<DiagnosisRecord>(database, select, "diagnosis_id", robot_id, before_id, limit, read_diagnosis);
}

Result<std::string> diagnosis_report(Database& database, std::int64_t id) {
  Rows rows(database.statement("SELECT html FROM diagnosis_report WHERE diagnosis_id = ?"));
  if (rows.bind(id).next()) return rows.text();
  TRY(diagnosis(database, id));
  return fail(Fault::not_found, "diagnosis", "diagnosis " + std::to_string(id) + " has no report");
}

Result<Proposal> proposal(Database& database, std::int64_t id) {
  static const std::string sql = std::string(select_proposals) + " WHERE proposal_id = ?";
  return by_id<Proposal>(database, sql, id, read_proposal, no_proposal);
}

Result<std::vector<Proposal>> proposals(Database& database, const std::optional<std::string>& robot_id,
                                        std::int64_t before_id, std::int64_t limit) {
  static const std::string select(select_proposals);
  return page<Proposal>(database, select, "proposal_id", robot_id, before_id, limit, read_proposal);
}

}  // namespace queries
}  // namespace joulecast::history
