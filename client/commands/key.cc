#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "access/robot_keys.h"
#include "access/sha256.h"
#include "client/commands/on_file.h"
#include "client/commands/table.h"
#include "signals/ids.h"

// The keys by which robots sign their telemetry, in the file of joulecastd's ingest.key_file.
namespace joulecast::client {
namespace {

struct KeyOptions {
  std::string file, robot_id;
};

Exit create_key(const KeyOptions& options) {
  if (!signals::is_valid_robot_id(options.robot_id))
    return report({Fault::invalid, "--robot-id", "\"" + options.robot_id + "\" is no robot id"});
  const std::string key = access::random_hex(access::robot_key_bytes);
  const auto add = [&](access::RobotKeys& keys) -> Result<void> {
    if (!keys.emplace(options.robot_id, access::from_hexadecimal(key).value()).second)
      return fail(Fault::conflict, "--robot-id", "has a key already; revoke it first");
    return {};
  };
  if (const auto done = access::change_robot_keys(options.file, add); !done) return report(done.error());
  std::puts(key.c_str());
  return Exit::ok;
}

Exit list_keys(const KeyOptions& options) {
  const auto keys = access::read_robot_keys(options.file);
  if (!keys) return report(keys.error());
  for (const auto& [robot_id, key] : *keys) fmt::print("{}\n", robot_id);
  return Exit::ok;
}

Exit revoke_key(const KeyOptions& options) {
  const auto remove = [&](access::RobotKeys& keys) -> Result<void> {
    if (keys.erase(options.robot_id) == 0)
      return fail(Fault::not_found, "--robot-id", options.robot_id + " has no key");
    return {};
  };
  if (const auto done = access::change_robot_keys(options.file, remove); !done) return report(done.error());
  return Exit::ok;
}

}  // namespace

void add_key(CLI::App& program, Exit& exit) {
  auto* group =
      program.add_subcommand("key", "Make and revoke the keys by which robots sign their telemetry");
  group->require_subcommand(1);
  FileCommands<KeyOptions> options(*group, "the file that the daemon's ingest.key_file names", exit);
  options
      .add("create",
           "Add a robot's key and print it for its publisher; from now on only the robot's signed telemetry "
           "is "
           "accepted",
           create_key)
      ->add_option("--robot-id", options->robot_id, "robot that signs with the key")
      ->required();
  options.add("list", "List the robots that have keys", list_keys);
  options
      .add("revoke", "Remove a robot's key; from now on the robot is treated as one without a key",
           revoke_key)
      ->add_option("--robot-id", options->robot_id, "robot of the key")
      ->required();
}

}  // namespace joulecast::client
