# bash completion of sonde: commands and options are those that its help lists; files elsewhere.
_sonde() {
  local current=${COMP_WORDS[COMP_CWORD]} words
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    words="$(sonde --help 2>/dev/null | sed -n 's/^  \([a-z]\+\) .*/\1/p') --help --version"
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
    return
  fi
  if [[ $current == -* ]]; then
    words=$(sonde "${COMP_WORDS[1]}" --help 2>/dev/null | sed -n 's/^  \(--[a-z0-9-]\+\).*/\1/p')
    mapfile -t COMPREPLY < <(compgen -W "$words --help" -- "$current")
  fi
}
complete -o default -F _sonde sonde
