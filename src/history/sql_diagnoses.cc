#include <initializer_list>
#include <string>

#include "base/try.h"
#include "history/sql_changes.h"
#include "history/sql_queries.h"
#include "history/sql_rows.h"

// Diagnoses and proposals as rows: the commands that change them and the queries that read them.
namespace joulecast::history {
namespace {

tl::unexpected<Error> none(const std::string& table, std::int64_t id) {
  return fail(Fault::not_found, table + "_id", "no " + table + " has id " + std::to_string(id));
}

template <class T>
Result<T> by_id(Database& database, const std::string& table, std::int64_t id) {
  TRY_ASSIGN(auto found, select_one<T>(database, "FROM " + table + " WHERE " + table + "_id = ?", id));
  if (!found) return none(table, id);
  return std::move(*found);
}

template <class T>
Result<std::vector<T>> page(Database& database, const std::string& table,
                            const std::optional<std::string>& robot_id, std::int64_t before_id,
                            std::int64_t limit, std::initializer_list<std::string_view> left_out) {
  TRY(check_limit("limit", limit, max_page_size));
  Rows rows(database,
            "SELECT " + columns_of<T>(0, left_out) + " FROM " + table + " WHERE " + table + "_id < ?" +
                (robot_id ? " AND robot_id = ?" : "") + " ORDER BY " + table + "_id DESC LIMIT ?",
            before_id);
  if (robot_id) rows.bind(*robot_id);
  rows.bind(limit);
  return read_all<T>(rows);
}

}  // namespace

Outcome SqlChanges::run(const AddDiagnosis& c) {
  const DiagnosisRecord& d = c.diagnosis;
  Rows(
      database_,
      "DELETE FROM diagnosis WHERE robot_id = ?1 AND state NOT IN ('queued', 'running') AND diagnosis_id <= "
      "(SELECT diagnosis_id FROM diagnosis WHERE robot_id = ?1 ORDER BY diagnosis_id DESC LIMIT 1 OFFSET ?2)",
      d.robot_id, kept_diagnoses - 1)
      .run();
  const std::int64_t id = insert_numbered(database_, "diagnosis", d);
  if (!writer_.empty()) Rows(database_, "INSERT INTO cluster_job VALUES (?, ?)", id, writer_).run();
  return id;
}

bool SqlChanges::has_job(std::int64_t diagnosis_id) {
  if (writer_.empty()) return true;
  Rows rows(database_, "SELECT 1 FROM cluster_job WHERE diagnosis_id = ? AND writer = ? FOR UPDATE",
            diagnosis_id, writer_);
  return rows.next();
}

Outcome SqlChanges::run(const UpdateDiagnosis& c) {
  const DiagnosisRecord& d = c.diagnosis;
  if (!has_job(d.id))
    return fail(Fault::conflict, "id", "another daemon has taken diagnosis " + std::to_string(d.id));
  static const std::string content = columns_of<DiagnosisRecord>(diagnosis_identity);
  static const std::string update =
      "UPDATE diagnosis SET (" + content + ") = (" + placeholders(content) + ") WHERE diagnosis_id = ?";
  Rows rows(database_, update);
  bind_record(rows, d, diagnosis_identity);
  const std::int64_t changed = rows.bind(d.id).run();
  if (changed == 0) return none("diagnosis", d.id);
  if (!writer_.empty() && d.state != DiagnosisState::queued && d.state != DiagnosisState::running)
    Rows(database_, "DELETE FROM cluster_job WHERE diagnosis_id = ?", d.id).run();
  if (!c.report_html.empty()) {
    static const std::string replace = insert_or_replace("diagnosis_report", "diagnosis_id", "html");
    Rows(database_, replace, d.id, c.report_html).run();
  }
  return d.id;
}

Outcome SqlChanges::run(const InterruptDiagnoses& c) {
  if (!writer_.empty()) return 0;  // another daemon takes over the abandoned diagnoses
  return Rows(database_,
              "UPDATE diagnosis SET state = 'interrupted', finished_utime_us = ?, error = 'the service "
              "stopped before it was done' WHERE state IN ('queued', 'running')",
              c.utime_us)
      .run();
}

Outcome SqlChanges::run(const AddProposal& c) {
  const Proposal& p = c.proposal;
  Rows(database_,
       "UPDATE proposal SET state = 'superseded' WHERE robot_id = ? AND kind = ? AND state = 'open'",
       p.robot_id, p.kind)
      .run();
  return insert_numbered(database_, "proposal", p);
}

Outcome SqlChanges::run(const CloseProposal& c) {
  const auto changed =
      Rows(database_,
           "UPDATE proposal SET state = ?, adopted_version = ? WHERE proposal_id = ? AND state = 'open'",
           name(c.state), c.adopted_version, c.id)
          .run();
  if (changed > 0) return c.id;
  TRY_ASSIGN(const auto stored, proposal(database_, c.id));
  return fail(Fault::conflict, "proposal",
              "proposal " + std::to_string(c.id) + " is " + std::string(name(stored.state)) + " already");
}

Result<DiagnosisRecord> Store::diagnosis(std::int64_t id) const {
  return read([&](Database& database) { return by_id<DiagnosisRecord>(database, "diagnosis", id); });
}

Result<std::vector<DiagnosisRecord>> Store::diagnoses(const std::optional<std::string>& robot_id,
                                                      std::int64_t before_id, std::int64_t limit) const {
  return read([&](Database& database) {
    return page<DiagnosisRecord>(database, "diagnosis", robot_id, before_id, limit,
                                 {"result_json", "model_json"});
  });
}

Result<std::string> Store::diagnosis_report(std::int64_t id) const {
  return read([&](Database& database) -> Result<std::string> {
    Rows rows(database, "SELECT html FROM diagnosis_report WHERE diagnosis_id = ?", id);
    if (rows.next()) return rows.text();
    TRY(by_id<DiagnosisRecord>(database, "diagnosis", id));
    return fail(Fault::not_found, "diagnosis", "diagnosis " + std::to_string(id) + " has no report");
  });
}

Result<Proposal> proposal(Database& database, std::int64_t id) {
  return by_id<Proposal>(database, "proposal", id);
}

Result<Proposal> Store::proposal(std::int64_t id) const {
  return read([&](Database& database) { return history::proposal(database, id); });
}

Result<std::vector<Proposal>> Store::proposals(const std::optional<std::string>& robot_id,
                                               std::int64_t before_id, std::int64_t limit) const {
  return read([&](Database& database) {
    return page<Proposal>(database, "proposal", robot_id, before_id, limit, {});
  });
}

}  // namespace joulecast::history
