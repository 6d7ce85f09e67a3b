#include "support/link.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <thread>
#include <utility>

namespace wire {
namespace {

int checked(long result, const char* what) {
  if (result < 0) throw std::system_error(errno, std::generic_category(), what);
  return static_cast<int>(result);
}

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

void wait_readable(int fd, int milliseconds, const char* what) {
  pollfd p{fd, POLLIN, 0};
  if (checked(::poll(&p, 1, milliseconds), what) > 0) return;
  throw std::system_error(ETIMEDOUT, std::generic_category(), what);
}

}  // namespace

Socket Socket::listening() {
  Socket socket(checked(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket"));
  const sockaddr_in address = loopback(0);
  checked(::bind(socket.fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), "bind");
  checked(::listen(socket.fd_, 8), "listen");
  return socket;
}

Socket Socket::connected_to(std::uint16_t port) {
  Socket socket(checked(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket"));
  const sockaddr_in address = loopback(port);
  checked(::connect(socket.fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), "connect");
  return socket;
}

Socket::~Socket() {
  if (fd_ >= 0) ::close(fd_);
}

Socket::Socket(Socket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

std::uint16_t Socket::port() const {
  sockaddr_in address{};
  socklen_t size = sizeof(address);
  checked(::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size), "getsockname");
  return ntohs(address.sin_port);
}

Socket Socket::accept() const {
  wait_readable(fd_, 10'000, "accept");
  return Socket(checked(::accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC), "accept"));
}

void Socket::send(std::span<const std::byte> bytes) const {
  while (!bytes.empty()) {
    const int sent = checked(::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL), "send");
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
}

std::size_t Socket::receive(std::span<std::byte> buffer) const {
  wait_readable(fd_, 30'000, "receive");
  return static_cast<std::size_t>(checked(::recv(fd_, buffer.data(), buffer.size(), 0), "receive"));
}

void RateLimit::take(std::size_t bytes) {
  const auto fill = [&] {
    const Clock::time_point now = Clock::now();
    tokens_ = std::min(tokens_ + rate_ * std::chrono::duration<double>(now - last_).count(), rate_ / 10);
    last_ = now;
  };
  fill();
  tokens_ -= static_cast<double>(bytes);  // a debt is waited for: a block goes out in one piece
  while (tokens_ < 0) {
    std::this_thread::sleep_for(std::chrono::duration<double>(-tokens_ / rate_));
    fill();
  }
}

}  // namespace wire
