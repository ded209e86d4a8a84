// Runs a fuzz target on mutations of its seeds for SECONDS: fuzz TARGET SECONDS SEED_FILE_OR_FOLDER...
// Before that, for a fifth of the time each, on its seeds truncated at every byte, and on its seeds with each
// allocation failing once. The same seeds give the same inputs. An input that crashes or hangs the target is
// written to crash-<pid>, which libFuzzer and this program (SECONDS 0: each seed once) can run again.
#include <fcntl.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <new>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "failing_new.h"
#include "fuzz.h"

namespace {

constexpr std::size_t max_input_bytes = 8192;
constexpr unsigned max_input_s = 20;

joulecast::testing::Target target = nullptr;
const std::string* running = nullptr;

void on_fault(int signal_number) {
  std::array<char, 64> name{};
  std::snprintf(name.data(), name.size(), "crash-%d", static_cast<int>(getpid()));
  if (const int file = open(name.data(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
      file >= 0 && running)
    (void)!write(file, running->data(), running->size());
  const std::string_view text = signal_number == SIGPROF ? "an input hangs; it is in crash-<pid>\n"
                                                         : "an input crashes; it is in crash-<pid>\n";
  (void)!write(STDERR_FILENO, text.data(), text.size());
  std::signal(SIGABRT, SIG_DFL);
  std::abort();
}

std::vector<std::string> read_seeds(int count, char** paths) {
  std::vector<std::string> seeds;
  const auto take = [&](const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    seeds.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  };
  for (int k = 0; k < count; ++k) {
    if (!std::filesystem::is_directory(paths[k])) {
      take(paths[k]);
      continue;
    }
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(paths[k]))
      if (entry.is_regular_file()) files.push_back(entry.path());
    std::ranges::sort(files);
    std::ranges::for_each(files, take);
  }
  return seeds;
}

class Mutator {
 public:
  explicit Mutator(const std::vector<std::string>& seeds) : seeds_(seeds) {}

  std::string next() {
    std::string text = any_seed();
    for (std::size_t k = 1 + below(8); k > 0; --k) mutate(text);
    if (text.size() > max_input_bytes) text.resize(max_input_bytes);
    return text;
  }

 private:
  std::size_t below(std::size_t bound) { return bound == 0 ? 0 : random_() % bound; }
  const std::string& any_seed() { return seeds_[below(seeds_.size())]; }

  void mutate(std::string& text) {
    static constexpr std::array<std::string_view, 20> words = {"0",
                                                               "-1",
                                                               "1e308",
                                                               "1e-320",
                                                               "NaN",
                                                               "18446744073709551616",
                                                               "-9223372036854775808",
                                                               "null",
                                                               "true",
                                                               "[]",
                                                               "{}",
                                                               "\"\"",
                                                               ",",
                                                               "\n",
                                                               "\xff\xff\xff\xff",
                                                               "\xc3",
                                                               "%00",
                                                               "[[[[",
                                                               "\\u0000",
                                                               "1e999"};
    const std::size_t at = below(text.size() + 1);
    const std::size_t length = below(std::min<std::size_t>(text.size() - at, 64) + 1);
    switch (below(7)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(text[at] ^ 1 << below(8));
        return;
      case 1:
        if (at < text.size()) text[at] = static_cast<char>(below(256));
        return;
      case 2:
        text.erase(at, length);
        return;
      case 3:
        text.insert(at, std::string(text, at, length));
        return;
      case 4:
        text.replace(at, length, words[below(words.size())]);
        return;
      case 5: {
        const std::string& other = any_seed();
        const std::size_t from = below(other.size() + 1);
        text.insert(at, other, from, below(128));
        return;
      }
      default:
        // Replaces a number.
        const std::size_t digit = text.find_first_of("0123456789", at);
        if (digit == std::string::npos) return;
        const std::size_t end = std::min(text.find_first_not_of("0123456789.eE+-", digit), text.size());
        text.replace(digit, end - digit, words[below(7)]);
    }
  }

  const std::vector<std::string>& seeds_;
  std::mt19937_64 random_{20261122};
};

using Clock = std::chrono::steady_clock;

// Limits processor time, as the waiting time on a busy machine is unbounded.
void limit_time(unsigned seconds) {
  itimerval limit{};
  limit.it_value.tv_sec = seconds;
  setitimer(ITIMER_PROF, &limit, nullptr);
}

void run(const std::string& input) {
  running = &input;
  limit_time(max_input_s);
  target(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
  limit_time(0);
}

std::uint64_t cut_short(const std::vector<std::string>& seeds, Clock::time_point until) {
  std::uint64_t runs = 0;
  for (std::size_t size = 0; size < max_input_bytes; ++size)
    for (const std::string& seed : seeds) {
      if (size >= seed.size()) continue;
      if (Clock::now() > until) return runs;
      run(seed.substr(0, size));
      ++runs;
    }
  return runs;
}

std::uint64_t without_memory(const std::vector<std::string>& seeds, Clock::time_point until) {
  using namespace joulecast::testing;
  std::uint64_t runs = 0;
  for (const std::string& seed : seeds)
    for (std::int64_t number = 1; Clock::now() < until; ++number, ++runs) {
      bool ended = false;
      try {
        fail_allocation(number);
        run(seed);
        ended = !allocation_failed();
      } catch (const std::bad_alloc&) {
        fail_allocation(0);
        limit_time(0);
      }
      if (ended) break;
    }
  return runs;
}

}  // namespace

int main(int argc, char** argv) {
  const auto found = joulecast::testing::targets().find(argc > 1 ? argv[1] : "");
  if (found == joulecast::testing::targets().end()) {
    std::fputs("no such target\n", stderr);
    return 2;
  }
  target = found->second;
  const int duration_s = argc > 2 ? std::atoi(argv[2]) : 0;
  std::vector<std::string> seeds = read_seeds(argc - 3, argv + 3);
  if (seeds.empty()) {
    std::fputs("no seeds\n", stderr);
    return 2;
  }
  for (const int each : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGPROF}) std::signal(each, on_fault);
  std::ranges::for_each(seeds, run);
  const auto began = Clock::now();
  const std::chrono::duration<double> whole(duration_s);
  const auto at = [&](double share) {
    return began + std::chrono::duration_cast<Clock::duration>(share * whole);
  };
  const std::uint64_t cut = cut_short(seeds, at(0.2)), starved = without_memory(seeds, at(0.4));
  Mutator mutator(seeds);
  std::uint64_t runs = 0;
  for (; Clock::now() < at(1); ++runs) run(mutator.next());
  std::printf("%llu mutations of %zu seeds, %llu seeds cut short, %llu allocations failed\n",
              static_cast<unsigned long long>(runs), seeds.size(), static_cast<unsigned long long>(cut),
              static_cast<unsigned long long>(starved));
}
