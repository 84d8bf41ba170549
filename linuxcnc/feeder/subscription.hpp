// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// Subscribes to the model of one machine and decides by the rule of abbe_v1.idl whether its grid
/// may be applied. The tool is not compared here, but in the loop of the feeder. Used by one
/// thread.

#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "abbe/dds/readers.hpp"
#include "abbe/dds/received_model.hpp"
#include "abbe/messages/error_lattice.hpp"
#include "abbe/subscriber/publisher_pin.hpp"
#include "correction_field.hpp"

namespace abbe::linuxcnc {

struct SubscriptionOptions {
  std::string machine;
  /// identity of the machine; empty: the first identity with this name is pinned
  std::string machine_id = {};
};

class Subscription {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::array kTopics{daemon::Topic::Identity, daemon::Topic::ModelState,
                                      daemon::Topic::ErrorModel, daemon::Topic::ErrorGrid};

  /// `readers` must outlive the subscription and read kTopics.
  Subscription(SubscriptionOptions options, dds::Readers& readers)
      : machine_(std::move(options.machine)),
        readers_(readers),
        pin_(std::move(options.machine_id), dds::PublisherPin::kSilenceOfSlowTopics) {}

  /// Waits for samples, at most `at_most`, and returns the present decision. The returned object
  /// changes only when the decision changes. Never null.
  [[nodiscard]] std::shared_ptr<const Usable> poll(std::chrono::milliseconds at_most);

 private:
  struct Publisher {
    dds::ReceivedModel model;
    std::optional<dds::WriterId> state_from;
    Clock::time_point state_at{};
  };

  void take(const dds::Arrival& arrival);
  /// Passes the sample to the publisher pin, and stores the reason if a publisher is not used.
  void judge(const dds::Arrival& arrival, const dds::ParticipantId& from);
  void keep(const dds::Arrival& arrival, Publisher& publisher);
  [[nodiscard]] bool alive(const Publisher& publisher) const;
  [[nodiscard]] std::string why_not() const;
  [[nodiscard]] std::string why_not_model(const Publisher& publisher) const;

  std::string machine_;
  dds::Readers& readers_;
  dds::PublisherPin pin_;
  std::map<dds::ParticipantId, Publisher> publishers_;
  std::string why_none_;  ///< reason why the publisher heard last is not used
  bool grid_changed_ = false;
  std::shared_ptr<const Usable> usable_ = std::make_shared<const Usable>();
};

}  // namespace abbe::linuxcnc
