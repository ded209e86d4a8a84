#include "datagram_script.h"

// Seeds: tests/fuzz/seeds/datagram, also used by datagram_test.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  joulecast::testing::run_datagram_script({data, size});
  return 0;
}
