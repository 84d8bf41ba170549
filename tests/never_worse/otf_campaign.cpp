// Random machines with typical faults of a shop floor, on-the-fly method. Prints for every fault
// how many models were accepted, how many of these make the machine worse, how many are wrong by
// more than three times their stated uncertainty, and how often the fault is the cause named first.
#include "campaign.hpp"
#include "otf_run.hpp"

int main(int argc, char** argv) {
  using namespace abbe::tests::never_worse;
  return run_campaign<OtfRun>({"on the fly", otf_faults(), random_otf_run, identify_and_compare},
                              argc, argv);
}
