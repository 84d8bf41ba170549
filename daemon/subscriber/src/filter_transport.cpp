#include <fastdds/rtps/transport/ChainingTransport.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "abbe/subscriber/internal/fragment_reassembly.hpp"
#include "abbe/subscriber/message_filter.hpp"
#include "rtps_fields.hpp"

namespace abbe::dds {
namespace {

namespace rtps = eprosima::fastdds::rtps;
using rtps_message::kLongestMessage;

/// Passes the bytes of the low-level transport through the filter to Fast DDS.
class MessageFilter final : public rtps::ChainingTransport {
 public:
  MessageFilter(const rtps::ChainingTransportDescriptor& descriptor, Protection protection,
                std::shared_ptr<SequenceWindow> window)
      : ChainingTransport(descriptor),
        descriptor_(descriptor.low_level_descriptor),
        protection_(protection),
        window_(std::move(window)) {}

  rtps::TransportDescriptorInterface* get_configuration() override { return descriptor_.get(); }

  bool send(eprosima::fastrtps::rtps::SenderResource* sender,
            const eprosima::fastrtps::rtps::octet* bytes, uint32_t size,
            eprosima::fastrtps::rtps::LocatorsIterator* begin,
            eprosima::fastrtps::rtps::LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& timeout) override {
    if (window_ != nullptr) window_->sent({bytes, size});
    return sender->send(bytes, size, begin, end, timeout);
  }

  void receive(rtps::TransportReceiverInterface* next, const eprosima::fastrtps::rtps::octet* bytes,
               uint32_t size, const eprosima::fastrtps::rtps::Locator_t& local,
               const eprosima::fastrtps::rtps::Locator_t& remote) override {
    // Twice the longest message. If Fast DDS reads up to a length that a message only states, it
    // stays within this buffer.
    thread_local std::vector<std::uint8_t> buffer(2 * kLongestMessage);
    if (size > kLongestMessage) return;
    std::copy_n(bytes, size, buffer.begin());
    Reassembly reassembly{fragments_, {}};
    pass(std::span(buffer).first(size), &reassembly, next, local, remote);
    for (const auto& message : reassembly.messages) {
      std::ranges::copy(message, buffer.begin());
      pass(std::span(buffer).first(message.size()), nullptr, next, local, remote);
    }
  }

 private:
  void pass(std::span<std::uint8_t> message, Reassembly* reassembly,
            rtps::TransportReceiverInterface* next,
            const eprosima::fastrtps::rtps::Locator_t& local,
            const eprosima::fastrtps::rtps::Locator_t& remote) {
    const bool may_be_fragments = protection_ != Protection::None;
    const std::size_t passed = filter_message(message, protection_, window_.get(),
                                              may_be_fragments ? reassembly : nullptr);
    if (passed > 0)
      next->OnDataReceived(message.data(), static_cast<std::uint32_t>(passed), local, remote);
  }

  std::shared_ptr<rtps::TransportDescriptorInterface> descriptor_;
  Protection protection_;
  std::shared_ptr<SequenceWindow> window_;
  FragmentReassembly fragments_;
};

struct FilterDescriptor final : rtps::ChainingTransportDescriptor {
  FilterDescriptor(std::shared_ptr<rtps::TransportDescriptorInterface> low_level,
                   Protection protects, std::shared_ptr<SequenceWindow> numbers)
      : ChainingTransportDescriptor(std::move(low_level)),
        protection(protects),
        window(std::move(numbers)) {}
  [[nodiscard]] rtps::TransportInterface* create_transport() const override {
    return new MessageFilter(*this, protection, window);
  }
  Protection protection;
  std::shared_ptr<SequenceWindow> window;
};

}  // namespace

std::shared_ptr<rtps::TransportDescriptorInterface> with_message_filter(
    std::shared_ptr<rtps::TransportDescriptorInterface> low_level, Protection protection,
    std::shared_ptr<SequenceWindow> window) {
  return std::make_shared<FilterDescriptor>(std::move(low_level), protection, std::move(window));
}

}  // namespace abbe::dds
