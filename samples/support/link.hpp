#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>

namespace wire {

/// A TCP socket on the loopback interface, closed at the end. Failures throw std::system_error.
class Socket {
 public:
  /// Waits for others on a port the system chooses.
  static Socket listening();
  static Socket connected_to(std::uint16_t port);
  explicit Socket(int fd) : fd_(fd) {}
  ~Socket();
  Socket(Socket&& other) noexcept;
  Socket& operator=(Socket&&) = delete;

  std::uint16_t port() const;
  /// The next that connects; an error after ten seconds without one.
  Socket accept() const;
  void send(std::span<const std::byte> bytes) const;
  /// What arrived, 0 at the end; an error after thirty seconds without anything.
  std::size_t receive(std::span<std::byte> buffer) const;

 private:
  int fd_;
};

/// Holds a sender to a rate: a bucket that fills with time, up to a tenth of a second's worth.
class RateLimit {
 public:
  explicit RateLimit(double bytes_per_s) : rate_(bytes_per_s), tokens_(bytes_per_s / 10) {}
  /// Waits until `bytes` may go.
  void take(std::size_t bytes);

 private:
  using Clock = std::chrono::steady_clock;
  double rate_;
  double tokens_;
  Clock::time_point last_ = Clock::now();
};

}  // namespace wire
