// The subscription of the LinuxCNC feeder without HAL, for the tests:
//   dds_linuxcnc_subscriber DOMAIN MACHINE [MACHINE_ID]
// Prints "usable MODEL" or "not usable: REASON" when this changes.
#include <cstdio>
#include <cstdlib>
#include <string>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/readers.hpp"
#include "subscription.hpp"

int main(int argc, char** argv) {
  using namespace abbe;
  if (argc < 3) return 2;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  auto participant =
      dds::Participant::create({.domain = static_cast<std::uint32_t>(std::atoi(argv[1])),
                                .profiles = ABBE_LOOPBACK_PROFILE});
  if (!participant) return 3;
  auto readers = dds::Readers::create(*participant, linuxcnc::Subscription::kTopics);
  if (!readers) return 4;

  linuxcnc::SubscriptionOptions options;
  options.machine = argv[2];
  options.machine_id = argc > 3 ? argv[3] : "";
  linuxcnc::Subscription subscription(options, *readers);
  for (std::string shown;;) {
    const auto usable = subscription.poll(std::chrono::milliseconds{20});
    const std::string now =
        usable->field ? "usable " + usable->model_id : "not usable: " + usable->reason;
    if (now != shown) std::puts(now.c_str());
    shown = now;
  }
}
