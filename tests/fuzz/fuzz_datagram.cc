#include "datagram_script.h"
#include "fuzz.h"

// Seeds: tests/fuzz/seeds/datagram, also used by datagram_test.
JOULECAST_FUZZ_TARGET(datagram) {
  joulecast::testing::run_datagram_script({data, size});
}
