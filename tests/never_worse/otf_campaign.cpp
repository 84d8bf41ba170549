// Random machines with typical faults of a shop floor, on-the-fly method. Prints for every fault
// how many models were accepted, how many of these make the machine worse, how many are wrong by
// more than three times their stated uncertainty, and how often the fault is the cause named first.
// ABBE_NEVER_WORSE_ESTIMATOR=two-step or simultaneous: instead of the default estimator.
#include <cstdlib>

#include "campaign.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::tests::never_worse;

OtfRun run_with_estimator(std::uint64_t seed) {
  OtfRun run = random_otf_run(seed);
  if (const char* name = std::getenv("ABBE_NEVER_WORSE_ESTIMATOR"); name != nullptr) {
    run.estimator = abbe::calib::otf::estimator(name).value();
  }
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  return run_campaign<OtfRun>(
      {"on the fly", otf_faults(), run_with_estimator, identify_and_compare}, argc, argv);
}
