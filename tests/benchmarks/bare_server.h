#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace joulecast::benchmarks {

// The yardstick of the HTTP benchmarks: what Beast does on one thread when asked for nothing else: parse,
// answer the same body, repeat.
class BareServer {
 public:
  explicit BareServer(std::string body);
  ~BareServer();
  std::uint16_t port() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace joulecast::benchmarks
