#pragma once

#include "signals/ledger.h"
#include "signals/sample.h"

namespace joulecast::signals {

// The members of samples and accounts, for the archive of base/byte_archive.h; `Members` of a program that
// holds them take these over by `using ArchiveMembers::of`.
struct ArchiveMembers {
  template <class Archive>
  static void of(Archive& a, Accounts& c) {
    a(c.battery_j, c.measured_j, c.measured_s, c.measured_motor_j, c.motor_measured_s, c.modelled_j,
      c.modelled_motor_j, c.drawn_j, c.returned_j, c.charge_ah, c.distance_m, c.turned_rad, c.duration_s,
      c.ledger.value);
  }
  template <class Archive>
  static void of(Archive& a, Sample& c) {
    a(c.utime_us, c.sequence);
    visit_fields(c, [&a](const SampleField&, double& number) { a(number); });
  }
};

}  // namespace joulecast::signals
