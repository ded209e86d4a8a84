#include <fmt/format.h>

#include <cstdio>
#include <string>

#include "access/robot_keys.h"
#include "access/sha256.h"
#include "base/try.h"
#include "client/commands/option.h"
#include "client/commands/table.h"
#include "signals/ids.h"

// The keys by which robots sign their telemetry, in the file of joulecastd's ingest.key_file.
namespace joulecast::client {
namespace {

struct KeyOptions {
  std::string file, robot_id;
};

Result<Exit> create_key(KeyOptions& options) {
  if (!signals::is_valid_robot_id(options.robot_id))
    return invalid("--robot-id", "\"" + options.robot_id + "\" is no robot id");
  const std::string key = access::random_hex(access::robot_key_bytes);
  const auto add = [&](access::RobotKeys& keys) -> Result<void> {
    if (!keys.emplace(options.robot_id, access::from_hexadecimal(key).value()).second)
      return fail(Fault::conflict, "--robot-id", "has a key already; revoke it first");
    return {};
  };
  TRY(access::change_robot_keys(options.file, add));
  std::puts(key.c_str());
  return Exit::ok;
}

Result<Exit> list_keys(KeyOptions& options) {
  TRY_ASSIGN(const auto keys, access::read_robot_keys(options.file));
  for (const auto& [robot_id, key] : keys) fmt::print("{}\n", robot_id);
  return Exit::ok;
}

Result<Exit> revoke_key(KeyOptions& options) {
  const auto remove = [&](access::RobotKeys& keys) -> Result<void> {
    if (keys.erase(options.robot_id) == 0)
      return fail(Fault::not_found, "--robot-id", options.robot_id + " has no key");
    return {};
  };
  TRY(access::change_robot_keys(options.file, remove));
  return Exit::ok;
}

}  // namespace

void add_key(CLI::App& program, Exit& exit) {
  using O = KeyOptions;
  auto& group =
      add_group(program, "key", "Create, list and revoke the keys with which robots sign their telemetry");
  const Row<O> file{"--file", &O::file, "key file: the daemon's ingest.key_file", file_of("json"), required},
      robot{"robot,--robot-id", &O::robot_id, "robot that signs with the key", named("ROBOT"), required};
  add_command<O>(group, exit, "create",
                 "Add a robot's key and print it for its publisher; from now on only the robot's signed "
                 "telemetry is accepted",
                 create_key, {file, robot}, "joulecast key create amr-07 --file keys.json");
  add_command<O>(group, exit, "list", "List the robots that have keys", list_keys, {file},
                 "joulecast key list --file keys.json");
  add_command<O>(group, exit, "revoke",
                 "Remove a robot's key; from now on the robot is treated as one without a key", revoke_key,
                 {file, robot}, "joulecast key revoke --file keys.json --robot-id amr-07");
}

}  // namespace joulecast::client
