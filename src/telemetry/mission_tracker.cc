#include "telemetry/mission_tracker.h"

#include <algorithm>
#include <utility>

namespace joulecast::telemetry {

SampleStep MissionTracker::on_sample(std::int64_t utime_us, double payload_kg) {
  SampleStep step;
  if (current_) close_if_over(step.actions, utime_us - current_->last_utime_us, utime_us - begin_us_);
  if (!current_) {
    const bool just_after_end = explicit_end_us_ && utime_us > *explicit_end_us_ &&
                                utime_us - *explicit_end_us_ <= limits_.after_end_us;
    if (just_after_end || lies_in_past(utime_us)) {
      ++counters_.samples_outside;
      return step;
    }
    open_implicit(step.actions, utime_us, payload_kg);
  }
  step.belongs = utime_us >= begin_us_;
  if (step.belongs) {
    current_->last_utime_us = std::max(current_->last_utime_us, utime_us);
  } else {
    ++counters_.samples_outside;
  }
  return step;
}

MissionActions MissionTracker::on_event(const signals::MissionEvent& event) {
  MissionActions actions;
  if (event.phase == signals::MissionPhase::started) {
    on_start(actions, event);
  } else {
    on_end(actions, event);
  }
  return actions;
}

MissionActions MissionTracker::on_silence(std::int64_t silent_us) {
  MissionActions actions;
  if (current_) close_if_over(actions, silent_us, 0);
  return actions;
}

MissionActions MissionTracker::on_restart() {
  MissionActions actions;
  if (current_ && current_->implicit) close(actions, current_->last_utime_us, MissionEnd::idle);
  return actions;
}

void MissionTracker::on_clock_step(std::int64_t utime_us) {
  for (Past& past : past_)
    if (past.implicit) past.to_us = past.from_us - 1;
  const bool began_after = current_ && current_->last_utime_us == begin_us_ && utime_us >= begin_us_ &&
                           utime_us - begin_us_ <= limits_.explicit_silence_us;
  if (!current_ || began_after) return;
  // The mission keeps the duration it had; the step itself is no time of it.
  begin_us_ += utime_us - current_->last_utime_us;
  current_->last_utime_us = utime_us;
}

void MissionTracker::resume(OpenMission mission) {
  begin_us_ = mission.start_utime_us;
  current_ = std::move(mission);
}

void MissionTracker::recall(OpenMission mission, bool was_said) {
  std::optional<std::int64_t> said_us;
  if (was_said) explicit_end_us_ = said_us = mission.last_utime_us;
  remember({std::move(mission.mission_id), mission.start_utime_us, said_us, mission.start_utime_us,
            mission.last_utime_us, mission.implicit});
}

void MissionTracker::close_if_over(MissionActions& actions, std::int64_t silent_us, std::int64_t lasted_us) {
  const bool implicit = current_->implicit;
  if (silent_us > (implicit ? limits_.implicit_idle_us : limits_.explicit_silence_us)) {
    close(actions, current_->last_utime_us, implicit ? MissionEnd::idle : MissionEnd::unfinished);
  } else if (lasted_us > (implicit ? limits_.implicit_max_us : limits_.explicit_max_us)) {
    close(actions, current_->last_utime_us, implicit ? MissionEnd::expired : MissionEnd::unfinished);
  }
}

bool MissionTracker::is_same_instant(std::int64_t said_us, std::int64_t other_us) const noexcept {
  return std::abs(said_us - other_us) <= limits_.reorder_us;
}

bool MissionTracker::any_past(std::string_view mission_id, auto is_it) const {
  return std::ranges::any_of(past_,
                             [&](const Past& past) { return past.mission_id == mission_id && is_it(past); });
}

void MissionTracker::on_start(MissionActions& actions, const signals::MissionEvent& event) {
  const auto repeats = [&](const Past& past) {
    return past.start_us && is_same_instant(*past.start_us, event.utime_us);
  };
  if ((current_ && current_->mission_id == event.mission_id &&
       is_same_instant(current_->start_utime_us, event.utime_us)) ||
      any_past(event.mission_id, repeats)) {
    ++counters_.duplicate_events;
    return;
  }
  // The start of an end that overtook it; not of a mission longer than any.
  const auto has_ended = [&](const Past& past) {
    return !past.start_us && past.said_end_us && event.utime_us <= *past.said_end_us &&
           *past.said_end_us - event.utime_us <= limits_.explicit_max_us;
  };
  if (any_past(event.mission_id, has_ended)) {
    ++counters_.out_of_order_events;
    return;
  }
  if (current_) {
    const std::int64_t older_us = begin_us_ - event.utime_us;
    if (!current_->implicit && older_us > 0 && older_us <= limits_.reorder_us) {
      ++counters_.out_of_order_events;
      return;
    }
    close(actions, current_->last_utime_us, MissionEnd::superseded);
  }
  open(actions, event.mission_id, event.utime_us, event.payload_kg, event.note, false);
}

void MissionTracker::on_end(MissionActions& actions, const signals::MissionEvent& event) {
  const MissionEnd end =
      event.phase == signals::MissionPhase::aborted ? MissionEnd::aborted : MissionEnd::finished;
  const bool of_current = current_ && current_->mission_id == event.mission_id;
  const bool before_current = of_current && event.utime_us < begin_us_;
  // A repetition, or late: of a mission that ended otherwise, or of an earlier one with the open one's name.
  const auto repeats = [&](const Past& past) {
    if (of_current) return before_current || past.said_end_us == event.utime_us;
    return !past.said_end_us || is_same_instant(*past.said_end_us, event.utime_us);
  };
  if (any_past(event.mission_id, repeats)) {
    ++counters_.duplicate_events;
    return;
  }
  if (of_current) {
    if (before_current) ++counters_.out_of_order_events;
    close(actions, before_current ? current_->last_utime_us : event.utime_us, end, event.note,
          event.utime_us);
    return;
  }
  ++counters_.unknown_missions;
  if (current_ && current_->implicit && event.utime_us >= begin_us_) {
    close(actions, event.utime_us, end, "reported by the robot as " + event.mission_id);
  } else if (current_ && event.utime_us > begin_us_ + limits_.reorder_us) {
    // A robot does one mission at a time: the one that ends now began after the open one; its start was lost.
    close(actions, event.utime_us, MissionEnd::superseded,
          "holds mission " + event.mission_id + " too; its start was not received");
    explicit_end_us_ = event.utime_us;
  }
  remember({event.mission_id, {}, event.utime_us});
}

void MissionTracker::open(MissionActions& actions, std::string id, std::int64_t utime_us, double payload_kg,
                          std::string note, bool implicit) {
  begin_us_ = utime_us;
  current_ = OpenMission{id, utime_us, utime_us, payload_kg, implicit};
  actions.push_back(
      {MissionAction::Kind::open, std::move(id), utime_us, implicit, payload_kg, {}, std::move(note)});
}

void MissionTracker::open_implicit(MissionActions& actions, std::int64_t utime_us, double payload_kg) {
  std::string id = "implicit-" + std::to_string(utime_us);
  // A clock that starts again may do so at the same time.
  const auto same = std::ranges::count_if(past_, [&](const Past& past) { return past.start_us == utime_us; });
  if (same > 0) id += "-" + std::to_string(same + 1);
  open(actions, std::move(id), utime_us, payload_kg, {}, true);
}

void MissionTracker::close(MissionActions& actions, std::int64_t utime_us, MissionEnd end, std::string note,
                           std::optional<std::int64_t> said_us) {
  // A sample may carry a slightly later clock than the event that ends its mission.
  const std::int64_t end_us = std::max(utime_us, current_->last_utime_us);
  if (end == MissionEnd::finished || end == MissionEnd::aborted) explicit_end_us_ = end_us;
  remember({current_->mission_id, current_->start_utime_us, said_us, begin_us_, end_us, current_->implicit});
  actions.push_back({MissionAction::Kind::close, std::move(current_->mission_id), end_us, current_->implicit,
                     current_->payload_kg, end, std::move(note)});
  current_.reset();
}

void MissionTracker::remember(Past past) {
  if (past_.size() == memory) past_.pop_front();
  past_.push_back(std::move(past));
}

bool MissionTracker::lies_in_past(std::int64_t utime_us) const noexcept {
  return std::any_of(past_.begin(), past_.end(),
                     [&](const Past& past) { return past.from_us <= utime_us && utime_us <= past.to_us; });
}

}  // namespace joulecast::telemetry
