#include "datagram_script.h"

// Seeds: tests/fuzz/seeds/datagram, which datagram_test runs too.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  joulecast::testing::run_datagram_script({data, size});
  return 0;
}
