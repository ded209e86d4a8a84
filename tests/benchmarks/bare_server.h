#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace joulecast::benchmarks {

// The reference of the HTTP benchmarks: a bare Beast server on one thread, which parses requests and always
// returns the same body.
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
