// The part of a receiver of lines that allocates.
#include "abbe/drivers/lines/receiver.hpp"

namespace abbe::drivers {

template <class Content>
LineReceiverOf<Content>::LineReceiverOf(const Options& options)
    : options_(options),
      has_time_(Content::has_time(options.format)),
      times_(options.clock, options.time_separation) {
  if (!options_.datagrams) framer_.resync();
}

template LineReceiverOf<LinePoints>::LineReceiverOf(const Options& options);
template LineReceiverOf<LineAxes>::LineReceiverOf(const Options& options);

}  // namespace abbe::drivers
