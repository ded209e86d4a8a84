// Cost of one sample from bytes to history, in parts, in one run: validation and decoding, metering, the
// whole session without a store, the whole pipeline into SQLite. Measures CPU time of the process, which
// includes the writer.
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "history/open_store.h"
#include "history/writer.h"
#include "ingest/pipeline.h"
#include "telemetry/codec.h"
#include "tests/benchmarks/noisy_drive.h"

namespace joulecast {
namespace {

constexpr std::int64_t samples_a_robot = 50'000;
constexpr int robots = 4;

struct Message {
  std::string channel;
  std::vector<std::uint8_t> bytes;
  std::int64_t utime_us = 0;
};

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::vector<Message> messages() {
  std::vector<Message> all;
  all.reserve(static_cast<std::size_t>(samples_a_robot) * robots);
  benchmarks::NoisyDrive drive;
  for (std::int64_t k = 0; k < samples_a_robot; ++k) {
    for (int r = 0; r < robots; ++r) {
      const std::string id = "bench-" + std::to_string(r);
      signals::Sample s = drive.at(static_cast<double>(k) * 0.02);
      s.utime_us = 1'750'000'000'000'000 + k * 20'000;
      s.sequence = k;
      all.push_back({telemetry::channel_of(telemetry::Subject::telemetry, id),
                     *telemetry::encode_telemetry(id, s), s.utime_us});
    }
  }
  return all;
}

class Timer {
 public:
  Timer(const char* what, std::size_t count) : what_(what), count_(count), began_(cpu_s()) {}
  double stop() const {
    const double each = (cpu_s() - began_) / static_cast<double>(count_) * 1e6;
    std::printf("%-46s %7.3f us a sample  %9.0f samples a core second\n", what_, each, 1e6 / each);
    return each;
  }

 private:
  const char* what_;
  std::size_t count_;
  double began_;
};

double decode_only(const std::vector<Message>& all) {
  ingest::IngestCounters counters;
  const Timer timer("guard and decode", all.size());
  for (const Message& m : all) {
    if (!ingest::decode_message(m.channel, m.bytes, m.utime_us, counters)) std::abort();
  }
  return timer.stop();
}

double meter_only(const std::vector<Message>& all) {
  ingest::IngestCounters counters;
  std::vector<signals::Sample> samples;
  for (std::size_t k = 0; k < all.size(); k += robots) {
    samples.push_back(std::get<signals::Sample>(
        ingest::decode_message(all[k].channel, all[k].bytes, all[k].utime_us, counters)->content));
  }
  energy::Meter meter(*dynamics::drive_model(benchmarks::robot_named("bench-0")), {},
                      [](const energy::MeterPoint&) {});
  const Timer timer("metering (all accounts)", samples.size());
  for (const signals::Sample& s : samples) {
    if (!meter.add(s)) std::abort();
  }
  return timer.stop();
}

double pipeline(const std::vector<Message>& all, const char* what, bool store_samples,
                const std::string& path) {
  std::filesystem::remove(path);
  auto store = history::open_store(path);
  if (!store) std::abort();
  history::Writer writer(**store, {});
  ingest::ModelRegistry models;
  for (int r = 0; r < robots; ++r) {
    const std::string id = "bench-" + std::to_string(r);
    if (!writer.execute(history::AddModel{id, 1, history::ModelOrigin::file, "", "{}", std::nullopt}))
      std::abort();
    if (!models.put(benchmarks::robot_named(id), 1)) std::abort();
  }
  ingest::FleetView fleet;
  ingest::IngestCounters counters;
  ingest::Pipeline ingest(
      {}, 100, models,
      {**store,
       [&](history::Command command) {
         if (store_samples) (void)writer.post(std::move(command));
       },
       fleet, counters, [](const std::string&, const std::string& text) { std::puts(text.c_str()); }});
  const Timer timer(what, all.size());
  for (const Message& m : all) {
    if (const auto message = ingest::decode_message(m.channel, m.bytes, m.utime_us, counters))
      ingest.handle(*message);
  }
  ingest.finish();
  if (!writer.flush()) std::abort();
  return timer.stop();
}

}  // namespace
}  // namespace joulecast

int main() {
  using namespace joulecast;
  const std::vector<Message> all = messages();
  const std::string path = (std::filesystem::temp_directory_path() / "joulecast-ingest-cost.db").string();
  const double decode = decode_only(all);
  const double meter = meter_only(all);
  const double session = pipeline(all, "decode, session, metering, trace; no store", false, path);
  const double whole = pipeline(all, "all of it into SQLite", true, path);
  std::printf(
      "\nshares of the whole: decode %.0f %%, metering %.0f %%, session and trace %.0f %%, store %.0f %%\n",
      100 * decode / whole, 100 * meter / whole, 100 * (session - decode - meter) / whole,
      100 * (whole - session) / whole);
  for (const char* suffix : {"", "-wal", "-shm", ".lock"}) std::filesystem::remove(path + suffix);
}
