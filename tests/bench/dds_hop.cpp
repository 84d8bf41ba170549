// One-way delay of 200 bytes from one process to another through plain Fast DDS, which is the lower
// limit of every delay of abbe. bench_wire_to_dds compares abbe with this delay in the same run.
#include "dds_hop.hpp"

#include <fmt/format.h>

int main() {
  abbe::bench::HopOptions options;
  options.profile = ABBE_LOOPBACK_PROFILE;
  const auto hop = abbe::bench::measure_dds_hop(options);

  if (hop.received == 0) {
    fmt::print(stderr, "bench_dds_hop: the two processes did not find each other on domain {}\n",
               options.domain);
    return 1;
  }

  fmt::print(
      "bare Fast DDS hop, {} B, best effort, UDP loopback, every {} us: p50 {:.1f} us, p99 {:.1f} "
      "us, {} of "
      "{} arrived\n",
      abbe::bench::hop::kMessageBytes, options.period.count(), hop.p50_us, hop.p99_us, hop.received,
      options.samples);
}
