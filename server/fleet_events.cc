#include "server/fleet_events.h"

#include "answers/mission.h"
#include "server/api/robot_json.h"
#include "server/http/text.h"

namespace joulecast::server {

std::string mission_event(const history::Mission& mission) {
  return http::rounded(answers::mission_table().text(mission));
}

void FleetEvents::publish_contradictions(const ingest::RobotSnapshot& now, Published& published) {
  for (const ingest::Contradiction& c : now.contradictions) {
    std::int64_t& last = published.contradictions[c.id + ' ' + c.channel];
    if (last == c.told_utime_us) continue;
    last = c.told_utime_us;
    hub_.publish("contradiction", http::rounded(api::contradiction_event_table().text({now.robot_id, c})),
                 now.robot_id);
  }
}

void FleetEvents::publish_ended(const ingest::RobotSnapshot& now, Published& published) {
  if (const auto& before = published.snapshot; own_ && !own_(now.robot_id) && before != nullptr &&
                                               before->mission_key > 0 &&
                                               before->mission_key != now.mission_key)
    published.ended.push_back(before->mission_key);
  std::erase_if(published.ended, [&](history::MissionKey key) {
    const auto mission = services_.store.mission(key);
    if (!mission) return mission.error().fault == Fault::not_found;
    if (mission->state == history::MissionState::open) return false;
    hub_.publish("mission", mission_event(*mission), now.robot_id);
    return true;
  });
}

void FleetEvents::publish(std::int64_t now_utime_us) {
  std::erase_if(published_, [&](const auto& each) { return services_.fleet.find(each.first) == nullptr; });
  recent_.keep([&](const std::string& id) { return services_.fleet.find(id) != nullptr; });
  for (const auto& snapshot : services_.fleet.all()) {
    recent_.take(*snapshot);
    Published& published = published_[snapshot->robot_id];
    const bool live = api::is_live(*snapshot, now_utime_us);
    publish_ended(*snapshot, published);
    if (published.snapshot == snapshot && published.live == live) continue;
    publish_contradictions(*snapshot, published);
    const auto model = services_.models.find(snapshot->robot_id);
    std::optional<forecast::Reach> reach;
    if (model != nullptr) reach = services_.forecasts.reach(model, *snapshot);
    hub_.publish("state", http::rounded(api::state_table().text({*snapshot, reach, now_utime_us})),
                 snapshot->robot_id, http::EventHub::Of::state);
    published.snapshot = snapshot;
    published.live = live;
  }
}

}  // namespace joulecast::server
