#pragma once

#include <array>
#include <boost/preprocessor/seq/for_each.hpp>
#include <boost/preprocessor/stringize.hpp>
#include <boost/preprocessor/variadic/to_seq.hpp>
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

// Members whose columns have their names.
#define VISIT_MEMBER(unused, record, member) visit(BOOST_PP_STRINGIZE(member), record.member);
#define VISIT_MEMBERS(record, ...) \
  BOOST_PP_SEQ_FOR_EACH(VISIT_MEMBER, record, BOOST_PP_VARIADIC_TO_SEQ(__VA_ARGS__))

template <class T, class Record>
concept Is = std::same_as<std::remove_const_t<T>, Record>;

// Of the terms of signals::Ledger: ledger_accessories_j and so on.
const std::array<std::string, signals::term_count>& ledger_columns();

template <Is<signals::Accounts> A, class Visit>
void visit_columns(A& a, Visit&& visit) {
  VISIT_MEMBERS(a, battery_j, measured_j, measured_s);
  visit("measured_motor_right_j", a.measured_motor_j[0]);
  visit("measured_motor_left_j", a.measured_motor_j[1]);
  visit("motor_measured_s", a.motor_measured_s);
  visit("modelled_j", a.modelled_j);
  visit("modelled_motor_right_j", a.modelled_motor_j[0]);
  visit("modelled_motor_left_j", a.modelled_motor_j[1]);
  VISIT_MEMBERS(a, drawn_j, returned_j, charge_ah, distance_m, turned_rad, duration_s);
  for (std::size_t k = 0; k < signals::term_count; ++k) visit(ledger_columns()[k], a.ledger.value[k]);
}

// The first members are the mission's identity; the others are its content, which a checkpoint replaces.
inline constexpr int mission_identity = 4;
template <Is<Mission> M, class Visit>
void visit_columns(M& m, Visit&& visit) {
  visit("mission_key", m.key);
  VISIT_MEMBERS(m, robot_id, mission_id, start_utime_us, end_utime_us, state, implicit, incomplete,
                incomplete_reason, payload_kg, note, model_version, samples, sample_faults, gap_count, gap_s);
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
  VISIT_MEMBERS(b, state_of_charge, measured_j, modelled_j, x_m, y_m);
}

template <Is<RobotRecord> R, class Visit>
void visit_columns(R& r, Visit&& visit) {
  VISIT_MEMBERS(r, robot_id, created_utime_us, active_version);
}

// All but `active`, which is a column of the robot.
template <Is<ModelVersion> M, class Visit>
void visit_columns(M& m, Visit&& visit) {
  VISIT_MEMBERS(m, robot_id, version, created_utime_us, origin, note, parent_version, model_json);
  visit("evidence_json", m.evidence_json, NullIfEmpty());
}

template <Is<ResumeState> S, class Visit>
void visit_columns(S& s, Visit&& visit) {
  VISIT_MEMBERS(s, robot_id, utime_us, sequence, state_of_charge);
  visit("winding_temperature_right_c", s.winding_temperature_c[0]);
  visit("winding_temperature_left_c", s.winding_temperature_c[1]);
}

template <Is<Learned> L, class Visit>
void visit_columns(L& l, Visit&& visit) {
  VISIT_MEMBERS(l, robot_id, topic, utime_us, body_json);
}

template <Is<AuditEntry> E, class Visit>
void visit_columns(E& e, Visit&& visit) {
  visit("audit_id", e.id);
  VISIT_MEMBERS(e, utime_us, actor, address, request_id, action, detail_json, hash);
}

template <Is<RequestAnswer> A, class Visit>
void visit_columns(A& a, Visit&& visit) {
  visit("actor", a.actor);
  visit("idempotency_key", a.key);
  VISIT_MEMBERS(a, fingerprint, utime_us, status, location, body);
}

template <Is<FloorPlan> P, class Visit>
void visit_columns(P& p, Visit&& visit) {
  VISIT_MEMBERS(p, map, level, utime_us, resolution_m, origin_x_m, origin_y_m, origin_yaw_rad);
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
  VISIT_MEMBERS(d, robot_id, created_utime_us, cause, request_json, started_utime_us, finished_utime_us,
                state, model_version, fitted_on, held_back);
  visit("summary_json", d.summary_json, NullIfEmpty());
  visit("result_json", d.result_json, NullIfEmpty());
  visit("model_json", d.model_json, NullIfEmpty());
  visit("error", d.error);
}

template <Is<Proposal> P, class Visit>
void visit_columns(P& p, Visit&& visit) {
  visit("proposal_id", p.id);
  VISIT_MEMBERS(p, robot_id, created_utime_us, kind, state, note, base_version, adopted_version, fitted_on,
                model_json, detail_json);
}

#undef VISIT_MEMBERS
#undef VISIT_MEMBER

}  // namespace joulecast::history
