#include "server/process_metrics.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

namespace joulecast::server {
namespace {

// Fields of /proc/self/stat from the third on, proc(5): the second, the program's name, may hold spaces.
std::vector<double> stat_fields() {
  std::ifstream file("/proc/self/stat");
  std::string text{std::istreambuf_iterator<char>(file), {}};
  text.erase(0, text.rfind(')') + 1);
  std::istringstream words(text);
  std::string state;
  words >> state;
  return {std::istream_iterator<double>(words), {}};
}

double boot_time_s() {
  std::ifstream file("/proc/stat");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("btime ")) return std::stod(line.substr(6));
  return 0;
}

double open_files() {
  std::error_code ignored;
  const std::filesystem::directory_iterator entries("/proc/self/fd", ignored);
  return static_cast<double>(std::distance(begin(entries), end(entries)));
}

std::vector<Metrics::Series> read_process() {
  const std::vector<double> stat = stat_fields();
  if (stat.size() < 21) return {};
  // Its fields are counted from 1, and the first of `stat` is the fourth.
  const auto field = [&](std::size_t number) { return stat[number - 4]; };
  const auto ticks = static_cast<double>(sysconf(_SC_CLK_TCK));
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  const auto one = [](std::string name, std::string help, double value) {
    return Metrics::Series{std::move(name), std::move(help), {{{}, value}}};
  };
  return {
      one("process_cpu_seconds_total", "User and system CPU time", (field(14) + field(15)) / ticks),
      one("process_start_time_seconds", "Start of the process since 1970", boot_time_s() + field(22) / ticks),
      one("process_threads", "Threads", field(20)),
      one("process_virtual_memory_bytes", "Virtual memory", field(23)),
      one("process_resident_memory_bytes", "Resident memory",
          field(24) * static_cast<double>(sysconf(_SC_PAGESIZE))),
      one("process_open_fds", "Open file descriptors", open_files()),
      one("process_max_fds", "Limit of open file descriptors", static_cast<double>(files.rlim_cur)),
  };
}

}  // namespace

void export_process_metrics(Metrics& metrics) {
  metrics
      .gauge("joulecast_build_info", "1; the labels contain the version and the compiler",
             {{"version", JOULECAST_VERSION}, {"compiler", "g++ " __VERSION__}})
      .set(1);
  metrics.series(read_process);
}

}  // namespace joulecast::server
