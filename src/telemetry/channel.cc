#include <utility>

#include "signals/ids.h"
#include "telemetry/codec.h"

namespace joulecast::telemetry {
namespace {

constexpr std::pair<Subject, std::string_view> prefixes[] = {{Subject::telemetry, "ROBOT_TELEMETRY."},
                                                             {Subject::mission_event, "MISSION_EVENT."},
                                                             {Subject::covariates, "ROBOT_COVARIATES."},
                                                             {Subject::energy_state, "ENERGY_STATE."}};

std::string_view prefix_of(Subject subject) noexcept {
  std::string_view found;
  for (const auto& [known, prefix] : prefixes) {
    if (known == subject) found = prefix;
  }
  return found;
}

}  // namespace

std::string channel_of(Subject subject, std::string_view robot_id) {
  return std::string(prefix_of(subject)).append(robot_id);
}

std::optional<ChannelName> parse_channel(std::string_view channel) noexcept {
  for (const auto& [subject, prefix] : prefixes) {
    if (!channel.starts_with(prefix)) continue;
    const std::string_view robot_id = channel.substr(prefix.size());
    if (!signals::is_valid_robot_id(robot_id)) return std::nullopt;
    return ChannelName{subject, robot_id};
  }
  return std::nullopt;
}

std::string channel_pattern(Subject subject) {
  std::string pattern(prefix_of(subject));
  return pattern.insert(pattern.size() - 1, "\\") +
         ".+";  // of the prefix only the last character, a '.', is special
}

}  // namespace joulecast::telemetry
