#include "history/sql_rows.h"

#include <nlohmann/json.hpp>

namespace joulecast::history {
namespace {

constexpr std::string_view plain_content_columns =
    "end_utime_us, state, implicit, incomplete, incomplete_reason, payload_kg, note, model_version, samples, "
    "sample_faults, gap_count, gap_s, findings_json, covariates_json";

// Visits the doubles of the accounts in the order of accounts_columns().
template <class A, class Visit>
void visit_accounts(A& a, Visit visit) {
  visit(a.battery_j);
  visit(a.measured_j);
  visit(a.measured_s);
  for (auto& value : a.measured_motor_j) visit(value);
  visit(a.motor_measured_s);
  visit(a.modelled_j);
  for (auto& value : a.modelled_motor_j) visit(value);
  visit(a.drawn_j);
  visit(a.returned_j);
  visit(a.charge_ah);
  visit(a.distance_m);
  visit(a.turned_rad);
  visit(a.duration_s);
  for (auto& value : a.ledger.value) visit(value);
}

void bind_band(Rows& rows, const Band& band) {
  rows.bind(band.min).bind(band.mean).bind(band.max);
}

Band read_band(Rows& rows) {
  Band band;
  band.min = rows.real();
  band.mean = rows.real();
  band.max = rows.real();
  return band;
}

// False if the text was not written by sample_faults_json().
bool parse_faults(const std::string& text, std::map<std::string, std::int64_t>& faults) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return false;
  for (const auto& [reason, count] : json.items()) {
    if (!count.is_number_integer()) return false;
    faults[reason] = count.get<std::int64_t>();
  }
  return true;
}

// False if the text was not written by covariates_json().
bool parse_covariates(const std::string& text, std::vector<CovariateSummary>& covariates) {
  if (text.empty()) return true;
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_array()) return false;
  const auto real = [](const nlohmann::json& value) {
    return value.is_number() ? value.get<double>() : signals::unmeasured;
  };
  for (const auto& row : json) {
    if (!row.is_array() || row.size() != 8 || !row[0].is_string() || !row[5].is_number_integer() ||
        !row[7].is_number_integer())
      return false;
    covariates.push_back({row[0].get<std::string>(), real(row[1]), real(row[2]), real(row[3]), real(row[4]),
                          row[5].get<std::int64_t>(), real(row[6]), row[7].get<std::int64_t>()});
  }
  return true;
}

}  // namespace

const std::string& accounts_columns() {
  static const std::string columns = [] {
    std::string text =
        "battery_j, measured_j, measured_s, measured_motor_right_j, measured_motor_left_j, motor_measured_s, "
        "modelled_j, modelled_motor_right_j, "
        "modelled_motor_left_j, drawn_j, returned_j, charge_ah, distance_m, turned_rad, duration_s";
    for (const std::string_view term : signals::term_names) text += ", ledger_" + std::string(term) + "_j";
    return text;
  }();
  return columns;
}

const std::string& mission_content_columns() {
  static const std::string columns = std::string(plain_content_columns) + ", " + accounts_columns();
  return columns;
}

void bind_mission_identity(Rows& rows, const Mission& m) {
  rows.bind(m.key).bind(m.robot_id).bind(m.mission_id).bind(m.start_utime_us);
}

void bind_mission_content(Rows& rows, const Mission& m, const std::string& faults_json,
                          const std::string& covariates_json) {
  rows.bind(m.end_utime_us).bind(name(m.state)).bind(m.implicit).bind(m.incomplete).bind(m.incomplete_reason);
  rows.bind(m.payload_kg).bind(m.note).bind(m.model_version).bind(m.samples).bind(faults_json);
  rows.bind(m.gap_count).bind(m.gap_s);
  m.findings_json.empty() ? rows.bind_null() : rows.bind(m.findings_json);
  covariates_json.empty() ? rows.bind_null() : rows.bind(covariates_json);
  visit_accounts(m.accounts, [&](double value) { rows.bind(value); });
}

std::string sample_faults_json(const Mission& mission) {
  // Reasons are internal names, but a stray byte in one must not throw.
  return nlohmann::json(mission.sample_faults).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string covariates_json(const Mission& mission) {
  if (mission.covariates.empty()) return {};
  nlohmann::json all = nlohmann::json::array();
  for (const CovariateSummary& c : mission.covariates)
    all.push_back({c.name, c.mean, c.min, c.max, c.known_s, c.counted_utime_us, c.value, c.value_utime_us});
  return all.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Result<Mission> read_mission(Rows& rows) {
  Mission m;
  m.key = rows.integer();
  m.robot_id = rows.text();
  m.mission_id = rows.text();
  m.start_utime_us = rows.integer();
  m.end_utime_us = rows.integer();
  const std::string state_name = rows.text();
  const auto state = mission_state_from(state_name);
  if (!state) return fail(Fault::corrupt, "mission.state", "unknown state '" + state_name + "'");
  m.state = *state;
  m.implicit = rows.boolean();
  m.incomplete = rows.boolean();
  m.incomplete_reason = rows.text();
  m.payload_kg = rows.real();
  m.note = rows.text();
  m.model_version = rows.optional_integer();
  m.samples = rows.integer();
  if (!parse_faults(rows.text(), m.sample_faults))
    return fail(Fault::corrupt, "mission.sample_faults", "not an object of counts");
  m.gap_count = rows.integer();
  m.gap_s = rows.real();
  m.findings_json = rows.text();
  if (!parse_covariates(rows.text(), m.covariates))
    return fail(Fault::corrupt, "mission.covariates_json", "not a list of covariates");
  m.accounts = read_accounts(rows);
  return m;
}

signals::Accounts read_accounts(Rows& rows) {
  signals::Accounts accounts;
  visit_accounts(accounts, [&](double& value) { value = rows.real(); });
  return accounts;
}

void bind_bucket(Rows& rows, const TraceBucket& b) {
  rows.bind(b.start_utime_us).bind(b.covered_s);
  bind_band(rows, b.measured_power_w);
  bind_band(rows, b.modelled_power_w);
  bind_band(rows, b.speed_m_s);
  rows.bind(b.state_of_charge).bind(b.measured_j).bind(b.modelled_j).bind(b.x_m).bind(b.y_m);
}

TraceBucket read_bucket(Rows& rows) {
  TraceBucket b;
  b.start_utime_us = rows.integer();
  b.covered_s = rows.real();
  b.measured_power_w = read_band(rows);
  b.modelled_power_w = read_band(rows);
  b.speed_m_s = read_band(rows);
  b.state_of_charge = rows.real();
  b.measured_j = rows.real();
  b.modelled_j = rows.real();
  b.x_m = rows.real();
  b.y_m = rows.real();
  return b;
}

void bind_resume_state(Rows& rows, const ResumeState& s) {
  rows.bind(s.robot_id).bind(s.utime_us).bind(s.sequence).bind(s.state_of_charge);
  for (const double celsius : s.winding_temperature_c) rows.bind(celsius);
}

ResumeState read_resume_state(Rows& rows) {
  ResumeState s;
  s.robot_id = rows.text();
  s.utime_us = rows.integer();
  s.sequence = rows.integer();
  s.state_of_charge = rows.real();
  for (double& celsius : s.winding_temperature_c) celsius = rows.real();
  return s;
}

}  // namespace joulecast::history
