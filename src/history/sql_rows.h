#pragma once

#include <string>
#include <string_view>

#include "base/error.h"
#include "history/records.h"
#include "history/sql.h"

// Records to and from rows: for each, its columns and the two functions that follow their order.
namespace joulecast::history {

// Comma-separated. A mission's identity, and its content, which a checkpoint replaces.
inline constexpr std::string_view mission_identity_columns =
    "mission_key, robot_id, mission_id, start_utime_us";
const std::string& mission_content_columns();
void bind_mission_identity(Rows& rows, const Mission& mission);
// The texts are sample_faults_json() and covariates_json() of the mission and must outlive the rows.
void bind_mission_content(Rows& rows, const Mission& mission, const std::string& faults_json,
                          const std::string& covariates_json);
std::string sample_faults_json(const Mission& mission);
std::string covariates_json(const Mission& mission);  // empty: none
// Reads identity and content columns. Fault::corrupt when a column's text has no meaning.
Result<Mission> read_mission(Rows& rows);

// The columns of signals::Accounts, a part of the mission's content.
const std::string& accounts_columns();
signals::Accounts read_accounts(Rows& rows);

// Without the start_utime_us, which comes first.
inline constexpr std::string_view trace_columns =
    "covered_s, measured_power_min_w, measured_power_mean_w, measured_power_max_w, "
    "modelled_power_min_w, modelled_power_mean_w, modelled_power_max_w, speed_min_m_s, speed_mean_m_s, "
    "speed_max_m_s, state_of_charge, measured_j, modelled_j, x_m, y_m";
void bind_bucket(Rows& rows, const TraceBucket& bucket);
TraceBucket read_bucket(Rows& rows);

// Without the robot_id, which comes first.
inline constexpr std::string_view resume_state_columns =
    "utime_us, sequence, state_of_charge, winding_temperature_right_c, winding_temperature_left_c";
void bind_resume_state(Rows& rows, const ResumeState& state);
ResumeState read_resume_state(Rows& rows);

}  // namespace joulecast::history
