#include "access/robot_keys.h"

#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "access/secret_file.h"
#include "access/sha256.h"
#include "base/json_fields.h"
#include "base/try.h"

namespace joulecast::access {
namespace {

constexpr std::size_t longest_robot_id = 47;

}  // namespace

Result<RobotKeys> parse_robot_keys(std::string_view json_text) {
  TRY_ASSIGN(const auto list, read_list(json_text, "keys"));
  RobotKeys keys;
  for (std::size_t k = 0; k < list.size(); ++k) {
    const std::string at = "/keys/" + std::to_string(k);
    Fields each((list)[k], at);
    const std::string robot_id = each.text("robot_id", longest_robot_id);
    const std::optional<std::string> key = from_hexadecimal(each.text("key", 2 * robot_key_bytes));
    if (each.ok() && (!key || key->size() != robot_key_bytes))
      each.fault("key", "must be 64 hexadecimal digits");
    TRY(each.finish());
    if (!keys.emplace(robot_id, *key).second)
      return invalid(at + "/robot_id", "is " + robot_id + ", which has a key already");
  }
  return keys;
}

std::string to_json_text(const RobotKeys& keys) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const auto& [robot_id, key] : keys)
    list.push_back({{"robot_id", robot_id}, {"key", hexadecimal(key)}});
  return nlohmann::ordered_json{{"keys", std::move(list)}}.dump(2) + "\n";
}

Result<RobotKeys> read_robot_keys(const std::string& path) {
  TRY_ASSIGN(const std::string text, read_guarded_file(path, true));
  Result<RobotKeys> keys = parse_robot_keys(text);
  if (!keys) return invalid(path, describe(keys.error()));
  return keys;
}

Result<void> change_robot_keys(const std::string& path,
                               const std::function<Result<void>(RobotKeys&)>& change) {
  return change_secret_file<RobotKeys>(path, read_robot_keys, to_json_text, change);
}

}  // namespace joulecast::access
