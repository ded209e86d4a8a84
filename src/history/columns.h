#pragma once

#include <array>
#include <concepts>
#include <string>
#include <type_traits>

#include "history/records.h"

// The stored records, described once: visit_columns() visits the members of a record with the names of their
// columns in schemas/store.sql. Statements, rows (sql_rows.h), spools and the weight of commands
// (command_members.h) follow from it.
namespace joulecast::history {

// How a text is stored: as NULL when it is empty, or as bytes.
struct NullIfEmpty {};
struct AsBytes {};

template <class T, class Record>
concept Is = std::same_as<std::remove_const_t<T>, Record>;

// Of the terms of signals::Ledger: ledger_accessories_j and so on.
const std::array<std::string, signals::term_count>& ledger_columns();

template <Is<signals::Accounts> A, class Visit>
void visit_columns(A& a, Visit&& visit) {
  visit("battery_j", a.battery_j);
  visit("measured_j", a.measured_j);
  visit("measured_s", a.measured_s);
  visit("measured_motor_right_j", a.measured_motor_j[0]);
  visit("measured_motor_left_j", a.measured_motor_j[1]);
  visit("motor_measured_s", a.motor_measured_s);
  visit("modelled_j", a.modelled_j);
  visit("modelled_motor_right_j", a.modelled_motor_j[0]);
  visit("modelled_motor_left_j", a.modelled_motor_j[1]);
  visit("drawn_j", a.drawn_j);
  visit("returned_j", a.returned_j);
  visit("charge_ah", a.charge_ah);
  visit("distance_m", a.distance_m);
  visit("turned_rad", a.turned_rad);
  visit("duration_s", a.duration_s);
  for (std::size_t k = 0; k < signals::term_count; ++k) visit(ledger_columns()[k], a.ledger.value[k]);
}

// The first members are the mission's identity; the others are its content, which a checkpoint replaces.
inline constexpr int mission_identity = 4;
template <Is<Mission> M, class Visit>
void visit_columns(M& m, Visit&& visit) {
  visit("mission_key", m.key);
  visit("robot_id", m.robot_id);
  visit("mission_id", m.mission_id);
  visit("start_utime_us", m.start_utime_us);
  visit("end_utime_us", m.end_utime_us);
  visit("state", m.state);
  visit("implicit", m.implicit);
  visit("incomplete", m.incomplete);
  visit("incomplete_reason", m.incomplete_reason);
  visit("payload_kg", m.payload_kg);
  visit("note", m.note);
  visit("model_version", m.model_version);
  visit("samples", m.samples);
  visit("sample_faults", m.sample_faults);
  visit("gap_count", m.gap_count);
  visit("gap_s", m.gap_s);
  visit("findings_json", m.findings_json, NullIfEmpty());
  visit("covariates_json", m.covariates);
  visit_columns(m.accounts, visit);
}

// The start and the mission's key are the key.
template <Is<TraceBucket> B, class Visit>
void visit_columns(B& b, Visit&& visit) {
  visit("start_utime_us", b.start_utime_us);
  visit("covered_s", b.covered_s);
  visit("measured_power_min_w", b.measured_power_w.min);
  visit("measured_power_mean_w", b.measured_power_w.mean);
  visit("measured_power_max_w", b.measured_power_w.max);
  visit("modelled_power_min_w", b.modelled_power_w.min);
  visit("modelled_power_mean_w", b.modelled_power_w.mean);
  visit("modelled_power_max_w", b.modelled_power_w.max);
  visit("speed_min_m_s", b.speed_m_s.min);
  visit("speed_mean_m_s", b.speed_m_s.mean);
  visit("speed_max_m_s", b.speed_m_s.max);
  visit("state_of_charge", b.state_of_charge);
  visit("measured_j", b.measured_j);
  visit("modelled_j", b.modelled_j);
  visit("x_m", b.x_m);
  visit("y_m", b.y_m);
}

template <Is<RobotRecord> R, class Visit>
void visit_columns(R& r, Visit&& visit) {
  visit("robot_id", r.robot_id);
  visit("created_utime_us", r.created_utime_us);
  visit("active_version", r.active_version);
}

// All but `active`, which is a column of the robot.
template <Is<ModelVersion> M, class Visit>
void visit_columns(M& m, Visit&& visit) {
  visit("robot_id", m.robot_id);
  visit("version", m.version);
  visit("created_utime_us", m.created_utime_us);
  visit("origin", m.origin);
  visit("note", m.note);
  visit("parent_version", m.parent_version);
  visit("model_json", m.model_json);
  visit("evidence_json", m.evidence_json, NullIfEmpty());
}

template <Is<ResumeState> S, class Visit>
void visit_columns(S& s, Visit&& visit) {
  visit("robot_id", s.robot_id);
  visit("utime_us", s.utime_us);
  visit("sequence", s.sequence);
  visit("state_of_charge", s.state_of_charge);
  visit("winding_temperature_right_c", s.winding_temperature_c[0]);
  visit("winding_temperature_left_c", s.winding_temperature_c[1]);
}

template <Is<Learned> L, class Visit>
void visit_columns(L& l, Visit&& visit) {
  visit("robot_id", l.robot_id);
  visit("topic", l.topic);
  visit("utime_us", l.utime_us);
  visit("body_json", l.body_json);
}

template <Is<AuditEntry> E, class Visit>
void visit_columns(E& e, Visit&& visit) {
  visit("audit_id", e.id);
  visit("utime_us", e.utime_us);
  visit("actor", e.actor);
  visit("address", e.address);
  visit("request_id", e.request_id);
  visit("action", e.action);
  visit("detail_json", e.detail_json);
  visit("hash", e.hash);
}

template <Is<RequestAnswer> A, class Visit>
void visit_columns(A& a, Visit&& visit) {
  visit("actor", a.actor);
  visit("idempotency_key", a.key);
  visit("fingerprint", a.fingerprint);
  visit("utime_us", a.utime_us);
  visit("status", a.status);
  visit("location", a.location);
  visit("body", a.body);
}

template <Is<FloorPlan> P, class Visit>
void visit_columns(P& p, Visit&& visit) {
  visit("map", p.map);
  visit("level", p.level);
  visit("utime_us", p.utime_us);
  visit("resolution_m", p.resolution_m);
  visit("origin_x_m", p.origin_x_m);
  visit("origin_y_m", p.origin_y_m);
  visit("origin_yaw_rad", p.origin_yaw_rad);
  visit("chargers_json", p.chargers);
  visit("media_type", p.media_type);
  visit("image", p.image, AsBytes());
}

template <Is<Event> E, class Visit>
void visit_columns(E& e, Visit&& visit) {
  visit("event_id", e.id);
  visit("utime_us", e.utime_us);
  visit("robot_id", e.robot_id, NullIfEmpty());
  visit("kind", e.kind);
  visit("detail_json", e.detail_json);
}

// As of a mission.
inline constexpr int diagnosis_identity = 5;
template <Is<DiagnosisRecord> D, class Visit>
void visit_columns(D& d, Visit&& visit) {
  visit("diagnosis_id", d.id);
  visit("robot_id", d.robot_id);
  visit("created_utime_us", d.created_utime_us);
  visit("cause", d.cause);
  visit("request_json", d.request_json);
  visit("started_utime_us", d.started_utime_us);
  visit("finished_utime_us", d.finished_utime_us);
  visit("state", d.state);
  visit("model_version", d.model_version);
  visit("fitted_on", d.fitted_on);
  visit("held_back", d.held_back);
  visit("summary_json", d.summary_json, NullIfEmpty());
  visit("result_json", d.result_json, NullIfEmpty());
  visit("model_json", d.model_json, NullIfEmpty());
  visit("error", d.error);
}

template <Is<Proposal> P, class Visit>
void visit_columns(P& p, Visit&& visit) {
  visit("proposal_id", p.id);
  visit("robot_id", p.robot_id);
  visit("created_utime_us", p.created_utime_us);
  visit("kind", p.kind);
  visit("state", p.state);
  visit("note", p.note);
  visit("base_version", p.base_version);
  visit("adopted_version", p.adopted_version);
  visit("fitted_on", p.fitted_on);
  visit("model_json", p.model_json);
  visit("detail_json", p.detail_json);
}

}  // namespace joulecast::history
