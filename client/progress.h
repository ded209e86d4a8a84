#pragma once

#include <boost/core/noncopyable.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace joulecast::client {

// A progress line on standard error: redrawn in place on a terminal, never written if standard error is a
// file or a pipe. It appears after one second; the destructor clears it.
class Progress : boost::noncopyable {
 public:
  // `work` is the activity ("replaying"), `unit` the counted items ("messages"); total 0: unknown in advance.
  Progress(std::string work, std::string unit, std::uint64_t total = 0);
  ~Progress();

  // Draws when the last drawing is older than a tenth of a second.
  void reach(std::uint64_t done) {
    done_ = done;
    draw_if_due();
  }
  void set_total(std::uint64_t total) { total_ = total; }
  // A callback for work that reports its completed share, 0 to 1, and checks whether to continue; the total
  // is 100 then. Must not outlive this.
  [[nodiscard]] std::function<bool(double)> shares() {
    return [this](double share) {
      reach(static_cast<std::uint64_t>(100 * share));
      return true;
    };
  }

 private:
  using Clock = std::chrono::steady_clock;
  void draw_if_due();

  std::string work_, unit_;
  std::uint64_t total_, done_ = 0;
  bool terminal_;
  bool drawn_ = false;
  Clock::time_point begin_ = Clock::now();
  Clock::time_point due_ = begin_ + std::chrono::seconds(1);
};

// The line's text for a terminal of `width` columns, without control characters: a bar if `total` is not 0,
// the rate, and the remaining time once it can be estimated.
[[nodiscard]] std::string progress_line(const std::string& work, const std::string& unit, std::uint64_t done,
                                        std::uint64_t total, double elapsed_s, std::size_t width);

}  // namespace joulecast::client
