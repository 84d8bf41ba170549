// Random machines with typical faults of a shop floor, Multi-Feature Bar. Prints the same table as
// never_worse_otf.
#include "campaign.hpp"
#include "mfb_run.hpp"

int main(int argc, char** argv) {
  using namespace abbe::tests::never_worse;
  return run_campaign<MfbRun>({"bar", mfb_faults(), random_mfb_run, identify_and_compare_mfb}, argc,
                              argv);
}
