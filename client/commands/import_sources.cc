#include "client/commands/import_sources.h"

#include <spawn.h>
#include <sys/wait.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "base/try.h"
#include "client/files.h"

namespace joulecast::client {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t max_line_bytes = std::size_t{1} << 20;

tl::unexpected<Error> unavailable(const std::string& what, int number, const char* advice = "") {
  return fail(Fault::unavailable, what, std::generic_category().message(number) + advice);
}

// The converter: next to the program in a build folder, or installed.
Result<fs::path> converter() {
  std::error_code unreadable;
  const fs::path folder = fs::read_symlink("/proc/self/exe", unreadable).parent_path();
  for (const char* place : {"bags.cjs", "../share/joulecast/deploy/import/bags.cjs"})
    if (fs::exists(folder / place, unreadable)) return folder / place;
  return fail(Fault::unavailable, "bags.cjs",
              "the converter of bags is not installed with " + folder.string() + "/joulecast");
}

Result<void> run_node(const fs::path& script, const std::string& request) {
  std::array<std::string, 3> words{"node", script.string(), request};
  std::array<char*, 4> arguments{words[0].data(), words[1].data(), words[2].data(), nullptr};
  pid_t child = 0;
  if (const int failed = posix_spawnp(&child, "node", nullptr, nullptr, arguments.data(), environ))
    return unavailable("node", failed, "; bags are read by Node.js 18 or later: `apt install nodejs`");
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return unavailable("node", errno);
  if (status != 0)
    return fail(Fault::unavailable, "node",
                "failed; bags are read by Node.js 18 or later, see `node --version`");
  return {};
}

}  // namespace

bool is_bag(const std::string& path) {
  std::error_code unreadable;
  if (fs::is_directory(path, unreadable)) return true;
  const std::string suffix = fs::path(path).extension().string();
  if (suffix == ".bag" || suffix == ".mcap" || suffix == ".db3") return true;
  std::string head(16, ' ');
  std::ifstream(path, std::ios::binary).read(head.data(), std::ssize(head));
  return head.starts_with("#ROSBAG V2.0") || head.starts_with("\x89MCAP0\r\n") ||
         head.starts_with("SQLite format 3");
}

Result<BagTables> convert_bags(const BagRequest& request) {
  TRY_ASSIGN(const auto script, converter());
  std::string folder = (fs::temp_directory_path() / "joulecast-import-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) return unavailable(folder, errno);
  const auto remove = [](const std::string* made) {
    std::error_code left;
    fs::remove_all(*made, left);
    delete made;
  };
  BagTables tables{{new std::string(folder), remove}, {}};
  const nlohmann::json asked{{"bags", request.bags},
                             {"out", folder},
                             {"mapping", request.mapping},
                             {"robot", request.robot},
                             {"robot_id", request.robot_id}};
  TRY(run_node(script, asked.dump()));
  TRY_ASSIGN(const auto text, read_file(folder + "/answer.json"));
  const nlohmann::json answer = nlohmann::json::parse(text);
  if (answer.contains("message")) return invalid(answer.at("field"), answer.at("message"));
  for (const nlohmann::json& one : answer.at("recordings"))
    tables.recordings.push_back({one.at("source"), folder + "/" + one.at("table").get<std::string>(),
                                 folder + "/" + one.at("mapping").get<std::string>(), one.at("lines")});
  return tables;
}

Result<telemetry::ImportMapping> read_mapping(const std::string& path) {
  TRY_ASSIGN(const auto text, read_file(path));
  return telemetry::ImportMapping::parse(text).map_error([&](Error error) {
    error.field = path + (error.field.empty() ? "" : "#" + error.field);
    return error;
  });
}

Result<std::vector<telemetry::Import>> import_table(const std::string& path,
                                                    const telemetry::ImportMapping& mapping,
                                                    telemetry::ImportOptions how) {
  TRY_ASSIGN(const auto text, read_file(path, max_line_bytes));
  for (const telemetry::JoinedFile& file : telemetry::joined_files(mapping, path)) {
    TRY_ASSIGN(how.joined[file.table], read_file(file.path, max_line_bytes));
  }
  how.source_name = path;
  return telemetry::import_missions(text, mapping, how);
}

void number_on(telemetry::Recording& recording, std::map<std::string, std::int64_t>& next) {
  for (signals::Sample& sample : recording.samples) sample.sequence = next[recording.robot_id]++;
}

}  // namespace joulecast::client
